"""Controllers compared on any rig, and a controller made from logs."""
