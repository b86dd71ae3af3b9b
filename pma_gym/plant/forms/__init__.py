"""Other forms of a plant's equations: linearised, symbolic, plain Python, text."""
