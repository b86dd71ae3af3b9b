"""Equilibria of plants: the states that stand still at constant commands."""
