"""All figures of the job, as its tables and its page take them."""

from dataclasses import dataclass
from typing import Any

from benchmarks.measured.detectability import Proposal, Undecidable
from benchmarks.measured.rounds import Round
from benchmarks.measured.steps import Step
from benchmarks.measured.triangles import Held


@dataclass(frozen=True)
class Measured:
    """Result of the job.

    Attributes:
        rounds: the diagnoses.
        steps: models with one effect more at a time.
        folds: rms errors of all effects with every pressure left out once, by figure.
        floors: scatter between repeats, by figure.
        smooth: rms errors at unseen pressures of a smooth function of the commands, by figure.
        not_detectable: effects that I2 and I3 cannot tell beside the amended model.
        proposals: experiments that would show them.
        held: models against the validation under triangular pressure.
        seconds: how long this run took (s), without stages kept from an earlier one.
        settings: what was diagnosed, and how many stages which code made.
    """

    rounds: list[Round]
    steps: list[Step]
    folds: dict[str, float]
    floors: dict[str, float]
    smooth: dict[str, float]
    not_detectable: list[Undecidable]
    proposals: list[Proposal]
    held: list[Held]
    seconds: float
    settings: dict[str, Any]
