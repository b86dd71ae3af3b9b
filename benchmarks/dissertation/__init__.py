"""The dissertation's figures, profiles and feed-forward voltages, recomputed."""
