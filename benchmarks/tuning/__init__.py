"""How gains are found: rows of the table, the linearised loop, what a trial costs."""
