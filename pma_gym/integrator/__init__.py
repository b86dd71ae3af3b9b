"""Numerical integration: one step attempt, step-size control, events, whole trials."""
