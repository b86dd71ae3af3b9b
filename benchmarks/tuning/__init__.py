"""Tuning of gains: rows of the table, linearised loop, cost of a trial."""
