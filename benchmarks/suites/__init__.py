"""Frozen suites: TOML files that pin every number, and their readers."""
