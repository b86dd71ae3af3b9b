"""A rotary joint: inertia and start, motor, weight, spring, damping and friction."""
