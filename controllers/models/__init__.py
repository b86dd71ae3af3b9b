"""Nominal models: the plant as controllers know it, its inverse, its linear and reduced forms."""
