"""The second wheel: controllers and benchmark for those who have no clone."""
