"""The fit of a model, with or without candidate effects, to whitened trials."""
