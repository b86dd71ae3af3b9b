"""Error budget of open-loop control: `python -m benchmarks budget`."""
