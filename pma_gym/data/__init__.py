"""Measurements: trials, calibrations, and the tables of the dissertation behind the models."""
