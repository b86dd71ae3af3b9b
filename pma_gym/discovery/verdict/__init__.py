"""Which of the five verdicts the evidence supports."""
