"""Trials in files: columns, units and clocks of a file to a trial in SI, and back."""
