"""The sensors: lag, noise, gain and offset errors, backlash."""
