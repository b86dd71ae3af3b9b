"""How often wild commands hurt an operator, with the safety layer and without."""
