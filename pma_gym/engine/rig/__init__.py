"""The engine of any rig: signals, commands and sensors come from the rig of the model."""
