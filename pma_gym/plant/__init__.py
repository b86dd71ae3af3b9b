"""Plants: a model's equations of motion, settled, stepped, simulated and linearised."""
