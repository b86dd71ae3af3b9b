"""A joint that turns: inertia and start, motor, weight, spring, damping and friction."""
