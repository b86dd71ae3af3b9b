"""The compiled control step of one or many environments, and the options that shape it."""
