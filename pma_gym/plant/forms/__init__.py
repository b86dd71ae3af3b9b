"""The equations of a plant in other forms: linear, as symbols, in plain Python, as text."""
