"""The muscle: rival force laws, spring, damping, hysteresis, creep and warm-up."""
