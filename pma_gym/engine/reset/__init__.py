"""Resets: draw pressure, station and disturbances, and solve for the equilibrium."""
