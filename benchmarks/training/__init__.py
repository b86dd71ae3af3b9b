"""Training of policies: presets, stations to train on, runs that resume, export."""
