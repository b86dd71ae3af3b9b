"""Rate of harm by adversarial commands, with the safety layer and without."""
