"""Finding the missing physics: one module a step."""
