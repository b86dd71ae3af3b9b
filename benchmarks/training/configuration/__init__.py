"""Presets: reading and checking them."""
