"""What the residual of a fit shows: tests of the residual, and a score of each candidate."""
