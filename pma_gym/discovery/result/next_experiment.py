"""The experiment that a diagnosis proposes."""

from dataclasses import dataclass
from typing import Any

from pma_gym.data.trial import Trial


@dataclass(frozen=True)
class NextExperiment:
    """What to measure next.

    Attributes:
        excitation: its name and settings in words.
        separates: candidates that it tells apart.
        expected_odds: likelihood ratio to expect between the two that are hardest to tell.
        minutes: how long it takes.
        trial: its commands.
    """

    excitation: str
    separates: tuple[str, ...]
    expected_odds: float
    minutes: float
    trial: Trial

    def document(self) -> dict[str, Any]:
        """The experiment in `diagnosis.json`; its commands are a file beside it."""
        return {
            "excitation": self.excitation,
            "separates": list(self.separates),
            "expected_odds": self.expected_odds,
            "minutes": self.minutes,
            "file": "next.csv",
        }
