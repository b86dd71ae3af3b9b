"""Pictures of the station at work."""
