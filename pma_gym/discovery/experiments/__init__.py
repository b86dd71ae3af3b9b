"""The next experiment: safe excitations, and what trials of them would tell."""
