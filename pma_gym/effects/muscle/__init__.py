"""The muscle: alternative force laws, spring, damping, hysteresis, creep and warm-up."""
