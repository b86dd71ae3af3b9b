"""The experiment that a diagnosis proposes."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pma_gym.data.trial import Trial
from pma_gym.renamed_names import renamed_attribute


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

    protocol = renamed_attribute("protocol", "excitation")

    def document(self) -> dict[str, Any]:
        """The experiment in `diagnosis.json`; its commands are a file beside it."""
        return {
            "excitation": self.excitation,
            "separates": list(self.separates),
            "expected_odds": self.expected_odds,
            "minutes": self.minutes,
            "file": "next.csv",
        }


def proposed_excitation(experiment: Mapping[str, Any]) -> str:
    """The excitation of `next_experiment` in a `diagnosis.json`; older files call it `protocol`."""
    return experiment["excitation" if "excitation" in experiment else "protocol"]
