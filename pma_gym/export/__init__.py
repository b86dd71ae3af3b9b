"""A model's plant for other programs: C99, FMU, MuJoCo."""
