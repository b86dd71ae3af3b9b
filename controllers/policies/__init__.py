"""Policies: networks, their files, and what maps measurements to entries, actions to volts."""
