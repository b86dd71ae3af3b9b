"""The compiled control step of one or many environments, and its options."""
