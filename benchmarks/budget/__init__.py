"""Why open-loop control misses: `python -m benchmarks budget`."""
