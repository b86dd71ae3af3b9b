"""Makes anew all that depends on the station's model: `python -m benchmarks remake`."""
