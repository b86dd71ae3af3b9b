"""Diagnosing cases and comparing each answer with the truth."""
