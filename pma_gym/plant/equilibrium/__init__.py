"""Equilibria of plants at constant commands."""
