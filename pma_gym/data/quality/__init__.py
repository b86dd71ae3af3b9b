"""Checks of what was measured: clipped sensors, gaps, readings far from all others."""
