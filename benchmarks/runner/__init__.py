"""Running cases: controllers, rollouts, processes, journals, and what a row was made with."""
