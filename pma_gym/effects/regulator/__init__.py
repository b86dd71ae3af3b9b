"""The pressure regulator and the chamber that it fills."""
