"""Achievable bounds: how closely a trial can be followed by whoever knows everything."""
