"""The sensors: lag, noise, gain and offset, play."""
