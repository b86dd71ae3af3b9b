"""Data sets: a folder of trials and what `dataset.toml` says about it."""
