"""The motor side: from voltage to load, with the rotor and what departs from a straight line."""
