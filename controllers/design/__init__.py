"""Gains and settings by loop and task, and the optimisation that controllers share."""
