"""Identifies `models/station.toml` from tables I2 and I3, and judges it on left-out pressures.

Table I1 is held against it: its zero of contraction is another one, so it cannot join the fit.
"""
