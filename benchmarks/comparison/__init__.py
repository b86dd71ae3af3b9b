"""Comparing controllers on frozen suites: run, add, remove, list."""
