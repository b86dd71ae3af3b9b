"""How often adversarial commands hurt an operator, with the safety layer and without."""
