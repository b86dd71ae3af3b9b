"""What a model may lack, and a model with what was added."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.grey_box.kept_fits import fit
from pma_gym.discovery.grey_box.prepared_trials import CLOSE, ROUGH, PreparedTrials
from pma_gym.discovery.grey_box.slots import slot
from pma_gym.effects import CATALOGUE
from pma_gym.effects.residual_law import FREE_LAW
from pma_gym.estimation.innovations import GreyBox, Point
from pma_gym.estimation.likelihood_fit import OTHERS, Coordinate, Fit

FREE_LAWS = {
    "slide": (
        "residual_force_of_position",
        "residual_force_of_velocity",
        "residual_damping_of_position",
    ),
    "joint": ("residual_torque_of_angle", "residual_torque_of_speed", "residual_damping_of_angle"),
}
"""Laws of free shape, by rig: forces over the position and over the speed, damping over the
position."""


@dataclass(frozen=True)
class Move:
    """One thing that a model may lack: an effect, a parameter that differs by trial, a clock.

    Attributes:
        name: of the effect, or the parameter's slot with its mark.
        promise: gain of log likelihood that the screening promises.
        numbers: how many it adds.
        candidate: the effect.
        probe: its most promising probe.
        amount: how many times the probe's size.
        slots: of parameters by trial, or `clock`, or `colour` and its memory.
        start: where its fit begins, if not at what it is added to.
    """

    name: str
    promise: float
    numbers: int
    candidate: CandidateEffect | None = None
    probe: int = 0
    amount: float = 0.0
    slots: tuple[str, ...] = ()
    start: Point | None = None

    @property
    def is_nuisance(self) -> bool:
        """Whether it is of the logging alone: no part of the rig."""
        return self.candidate is None and set(self.slots) <= set(OTHERS)

    @property
    def is_free_law(self) -> bool:
        """Whether it is a law of free shape: no effect of the catalogue has its shape."""
        return bool(self.candidate) and CATALOGUE[self.candidate.effect].replaces == FREE_LAW


@dataclass(frozen=True)
class Hypothesis:
    """A model with what was added, and its fit.

    Attributes:
        box: its filter.
        fit: its fit.
        moves: what was added.
        rivals: names of moves that would have done as well as the last one.
        alike: hypotheses with these in the place of the last move.
    """

    box: GreyBox
    fit: Fit
    moves: tuple[Move, ...] = ()
    rivals: tuple[tuple[str, ...], ...] = ()
    alike: tuple["Hypothesis", ...] = ()

    @property
    def free_law(self) -> CandidateEffect | None:
        """The law of free shape among what was added."""
        return next((move.candidate for move in self.moves if move.is_free_law), None)

    @property
    def latent(self) -> float:
        """Sum over trials of the latent force's mean square (N^2, N^2 m^2)."""
        return float(np.sum(np.square(self.fit.point.forces)))

    @property
    def readings(self) -> int:
        """How many readings it is fitted to."""
        return sum(int(trial.there.sum()) for trial in self.box.rows)

    def price_of(self, numbers: int) -> float:
        """Log likelihood that so many further numbers must gain (BIC)."""
        return 0.5 * numbers * float(np.log(self.readings))


def added_paths(candidate: CandidateEffect) -> list[str]:
    """Paths of a candidate that are fitted with it: ties and further terms stay out."""
    law = CATALOGUE[candidate.effect]
    apart = {stem for tie in law.ties for stem in tie[1:]} | {
        stem for term in law.terms for stem in term
    }
    return [path for path in candidate.fitted_paths if slot(path).partition(".")[2] not in apart]


def precise_fit(
    trials: PreparedTrials,
    box: GreyBox,
    start: Point,
    coordinates: Sequence[Coordinate],
    tied: Mapping[str, str],
    rough: bool = False,
    linear: bool | None = None,
) -> Hypothesis:
    """A fit with as many integration steps as it needs where it begins and where it ends.

    Args:
        trials: that are fitted to.
        box: a filter of the model.
        start: where to begin.
        coordinates: what is free.
        tied: slots that follow another slot.
        rough: whether to end early, for a comparison of starts.
        linear: whether commands are linear between rows; None: as the likeliest fit has them.
    """
    level = ROUGH if rough else CLOSE
    box = trials.precise(box.model, start, linear=linear, level=level)
    made = fit(box, start, coordinates, tied, rough)
    while not trials.is_missed(trials.white(box, [made.point])):
        finer = trials.precise(box.model, made.point, box.rows[0].steps, linear, level)
        if finer.rows[0].steps == box.rows[0].steps:
            break
        box, made = finer, fit(finer, made.point, coordinates, tied, rough, near=True)
    return Hypothesis(box, made)
