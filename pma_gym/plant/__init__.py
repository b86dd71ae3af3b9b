"""Plants: a model's equations of motion, their equilibria, simulation and linearisation."""
