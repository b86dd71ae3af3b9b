"""Effects whose law fits only approximately: how much of the misfit they close, and what is left.

An effect of the catalogue that closes most of the misfit beyond noise, on readings that its fit had
not seen, is missing in the model even where its law leaves structure: a dead zone with a smooth
edge is a dead zone. It is named with its size and with what its law leaves. Several effects
together close most of any misfit, so it must be one; terms of one law, such as a dry friction and
its growth with pressure, count as one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pma_gym.discovery.result.misfit import Gap
from pma_gym.discovery.thresholds import APPROXIMATE_LEFT, LEAST_MISFIT, LEFT
from pma_gym.effects import CATALOGUE


@dataclass(frozen=True)
class Closing:
    """How much of the misfit beyond noise effects close.

    Attributes:
        left: share of the mean square beyond noise that they leave, summed over signals in units
            of their noise.
        held_out: whether it is that of readings which the fits had not seen.
        laws: how many laws close it; effects whose memory follows one law are one.
    """

    left: float
    held_out: bool
    laws: int

    @property
    def closed(self) -> float:
        """The share that they close."""
        return 1.0 - self.left

    @property
    def named(self) -> bool:
        """Whether the effect is named although its law is only approximate."""
        return self.held_out and self.laws == 1 and self.left <= APPROXIMATE_LEFT

    @property
    def worth_saying(self) -> bool:
        """Whether so much is closed that the size means something."""
        return self.left <= LEFT


def closing(gaps: Mapping[str, Gap], effects: Sequence[str]) -> Closing | None:
    """How much of the misfit that refitted parameters leave is closed by the proposed model.

    Args:
        gaps: by signal.
        effects: names of those that the proposed model has more.
    Returns:
        It; None where the parameters leave too little beyond noise.
    """
    before = sum(_beyond(gap.parameters, gap.floor) for gap in gaps.values())
    after = sum(_beyond(gap.after, gap.floor) for gap in gaps.values())
    if before < LEAST_MISFIT:
        return None
    return Closing(after / before, all(gap.held_out for gap in gaps.values()), _laws(effects))


def _laws(names: Sequence[str]) -> int:
    """How many laws effects have."""
    laws: list[str] = []
    for name in names:
        known = [CATALOGUE[other] for other in laws if other in CATALOGUE]
        if name not in CATALOGUE or not any(CATALOGUE[name].shares_law(each) for each in known):
            laws.append(name)
    return len(laws)


def _beyond(misfit: float, floor: float) -> float:
    """Mean square beyond noise, in units of that of the noise."""
    return max((misfit / floor) ** 2 - 1.0, 0.0) if floor > 0.0 else 0.0
