"""`python -m benchmarks measured`: the diagnosis on the dissertation's own measurements."""
