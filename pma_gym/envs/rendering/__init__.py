"""Pictures of the station during an episode."""
