"""The dissertation's trials: scores, replay, targets and report."""
