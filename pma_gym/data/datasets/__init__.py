"""Data sets: a folder of trials and its description in `dataset.toml`."""
