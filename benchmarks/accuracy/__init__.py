"""Accuracy of the simulation: against scipy, and in limits of the equations."""
