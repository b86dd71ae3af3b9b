"""The commands of `python -m benchmarks`, one subject a module."""
