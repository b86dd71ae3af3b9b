"""Identifies `models/station.toml` from tables I1, I2 and I3, and judges it on left-out pressures.

Tables 20-30 take no part: they stay validation.
"""
