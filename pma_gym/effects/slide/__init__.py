"""The slide: its mass, its friction, a hand that pushes it, and the initial state if it is free."""
