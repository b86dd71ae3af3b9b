"""The operator of an exercise device: a person as the motor plays him, drawn anew at every reset.

    wish   = effort * plan(intended angle) * (1 + unsteadiness * w)
    d'     = (wish - d) / rise
    M      = d (1 + tremor sin(2 pi f t)) + stiffness * (intended angle - angle)
    M      is held between 0 and c strength s(angle + foresight * speed)
    c'     = -fatigue c M / (strength s),   c the freshness, 1 at the start

The intended angle is the ideal one, `reaction` late. The plan is the moment that the exercise takes
at an angle, as far as somebody knows who has done it before: what the device gives at the trial's
first pressure where it is to hold the speed, and the prescription where it is to hold a moment. He
errs in it by his effort. w wanders with a time constant of 0.3 s; s(angle) is the shape of the
knee's largest torque (`pma_gym.plant.exercise_device.knee`), which ends beyond the straight leg;
he sees it coming and slackens before. He extends the knee and never pulls it back.

Where the device sets the pace he pushes and lets it move him (`stiffness` near 0); where it sets
the moment he moves his leg where he means it to be (`stiffness` of a joint that resists).

Source:
    Each range of `Population` says where it comes from. Ranges marked as assumptions are ours.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pma_gym.codegen.generic import floor, where
from pma_gym.codegen.random import normals, philox, sine_cosine, uniforms
from pma_gym.plant.exercise_device.knee import BODY_HEIGHT, BODY_MASS, GRAVITY, STRENGTH, knee_share

WANDER_S = 0.3
"""Time constant of the unsteadiness (s): most of it lies below 2 Hz, an assumption."""

FARTHEST_WANDER = 2.5
"""Standard deviations at which the unsteadiness is cut off."""

FORESIGHT_S = 0.05
"""How far he looks ahead to the end of his reach (s), an assumption: without it he would bounce off
it."""

OWN_STREAM = 1
"""Third word of the counters of a person's random numbers, 0 for all others."""


class Operator(NamedTuple):
    """A person, in SI.

    Attributes:
        strength: largest torque of his knee, at its best angle (N m).
        effort: what he gives over what the exercise takes, 1.
        reaction: how late he follows a cue (s).
        rise: time constant of his moment (s).
        unsteadiness: standard deviation of his moment over its mean, 1.
        tremor: amplitude of his tremor over his moment, 1.
        tremor_rate: its frequency (Hz).
        tremor_phase: its phase at the start (turns, 0 to 1).
        fatigue: strength lost in a second of the greatest effort (1/s).
        stiffness: of the knee about the angle where he means it to be (N m/rad).
    """

    strength: float
    effort: float
    reaction: float
    rise: float
    unsteadiness: float
    tremor: float
    tremor_rate: float
    tremor_phase: float
    fatigue: float
    stiffness: float


OPERATOR_BOUNDS: dict[str, tuple[float, float, str]] = {
    "strength": (1.0, 600.0, "N m"),
    "effort": (0.0, 5.0, "(of what the exercise takes)"),
    "reaction": (0.0, 2.0, "s"),
    "rise": (0.001, 2.0, "s"),
    "unsteadiness": (0.0, 0.5, "(of the moment)"),
    "tremor": (0.0, 0.5, "(of the moment)"),
    "tremor_rate": (0.0, 25.0, "Hz"),
    "tremor_phase": (0.0, 1.0, "turns"),
    "fatigue": (0.0, 1.0, "1/s"),
    "stiffness": (0.0, 200.0, "N m/rad"),
}
"""What a person's numbers must lie between, and their units: beyond is a slip of the pen."""

TYPICAL_STRENGTH = STRENGTH * BODY_MASS * GRAVITY * BODY_HEIGHT
"""Largest torque of a young man's knee (N m): `pma_gym.plant.exercise_device.knee`."""


class Population(NamedTuple):
    """Distribution of operators: every parameter uniform between two bounds.

    Attributes:
        low: the least of every number.
        high: the greatest.
    """

    low: Operator
    high: Operator

    @property
    def typical(self) -> Operator:
        """The middle of every range; no phase of the tremor."""
        middle = (0.5 * (low + high) for low, high in zip(self.low, self.high, strict=True))
        return Operator(*middle)._replace(tremor_phase=0.0)

    def draw(self, keys: NDArray[np.int64], streams: NDArray[np.int64]) -> NDArray[np.float64]:
        """Draw operators, as a function of counters: shape (n, numbers of a `Operator`).

        Args:
            keys: two words for each, shape (n, 2).
            streams: a word for each, shape (n,).
        """
        words = [keys[:, i].astype(np.uint64) for i in range(2)]
        streamed, nothing = streams.astype(np.uint64), np.zeros(len(streams), np.uint64)
        own = nothing + np.uint64(OWN_STREAM)
        shares: list[NDArray[np.float64]] = []
        for i in range(math.ceil(len(Operator._fields) / 4)):
            counter = nothing + np.uint64(i), streamed, own, nothing
            shares.extend(uniforms(philox(counter, (words[0], words[1]))))
        low, high = np.array(self.low), np.array(self.high)
        return low + np.stack(shares[: len(low)], axis=1) * (high - low)


PACED = Population(
    low=Operator(
        strength=0.6 * TYPICAL_STRENGTH,
        effort=0.75,
        reaction=0.15,
        rise=0.08,
        unsteadiness=0.015,
        tremor=0.0,
        tremor_rate=8.0,
        tremor_phase=0.0,
        fatigue=0.3 / 60.0,
        stiffness=0.0,
    ),
    high=Operator(
        strength=1.2 * TYPICAL_STRENGTH,
        effort=1.2,
        reaction=0.3,
        rise=0.2,
        unsteadiness=0.04,
        tremor=0.005,
        tremor_rate=12.0,
        tremor_phase=1.0,
        fatigue=2.0 / 60.0,
        stiffness=5.0,
    ),
)
"""Operators whose pace the device sets.

Strength: young adults scatter by about 24 % (200 +- 47 N m in men, Arthroscopy, Sports Medicine
and Rehabilitation 2024), women have about 0.72 of it, and two weeks in bed take 15 % (U. Marusic
and others 2021). Reaction: 0.21 s to a light (D. L. Woods and others 2015, Frontiers in Human
Neuroscience 9, 131); that people differ by so much is an assumption. Rise: a pulse takes 0.1 s, an
unhurried one longer; an assumption. Unsteadiness: 2-4 % of the moment (B. L. Tracy and R. M. Enoka
2002, Journal of Applied Physiology 92, 1004, from memory; here from 1.5 % on). Tremor: 8-12 Hz;
its size is an assumption. Fatigue: L. Ma and others 2009, International Journal of Industrial
Ergonomics 39, 211, with 1 in a minute, 0.5 of it the spread between men (at the shoulder; none was
found of the knee). Effort and stiffness are assumptions: somebody who pushes and is moved.
"""

PACING = Population(
    PACED.low._replace(effort=0.85, stiffness=20.0),
    PACED.high._replace(effort=1.15, stiffness=60.0),
)
"""People who keep the pace themselves, against a moment that the device sets.

Stiffness: 20-40 N m/rad and 2-7 of the moment per rad more; an assumption, for what was measured is
of the ankle, or within 1-3 deg. Effort: an assumption.
"""


class MomentProfile(NamedTuple):
    """Moment over the angle, linear between its knots and constant beyond; numbers or values.

    Attributes:
        first: moment at the first knot (N m).
        angles: angles of the knots (rad), rising.
        slopes: slopes between them (N m/rad), one less.
    """

    first: Any
    angles: Sequence[Any]
    slopes: Sequence[Any]

    def at(self, angle: Any) -> Any:  # noqa: ANN401
        """Moment (N m) at an angle (rad)."""
        moment = self.first
        for i, slope in enumerate(self.slopes):
            moment = moment + slope * _clipped_to(angle - self.angles[i], self._width(i))
        return moment

    def _width(self, i: int) -> Any:  # noqa: ANN401
        return self.angles[i + 1] - self.angles[i]


def moment_profile(angles: Sequence[float], moments: Sequence[float]) -> MomentProfile:
    """The plan through knots: angles (rad) and moments (N m)."""
    slopes = np.diff(moments) / np.diff(angles)
    return MomentProfile(float(moments[0]), tuple(map(float, angles)), tuple(slopes.tolist()))


class OperatorState(NamedTuple):
    """State of an operator from step to step.

    Attributes:
        drive: moment that he means to give, as far as it has risen (N m).
        wander: where his unsteadiness is, in standard deviations.
        freshness: share of his strength that is left.
    """

    drive: Any
    wander: Any
    freshness: Any


def operator_step(
    operator: Operator,
    state: OperatorState,
    wish: Any,  # noqa: ANN401
    away: Any,  # noqa: ANN401
    coming: Any,  # noqa: ANN401
    time: Any,  # noqa: ANN401
    normal: Any,  # noqa: ANN401
    period: float,
    share: Any,  # noqa: ANN401
) -> tuple[Any, OperatorState]:
    """Compute an operator's moment during a control step, and the state after it.

    Numbers or traced values; the equations are the module's, a step long.

    Args:
        operator: who.
        state: as it was before the step.
        wish: effort times plan at the intended angle (N m).
        away: intended angle less the true one (rad).
        coming: angle of the knee so far ahead as he sees (rad).
        time: since the trial began (s).
        normal: a standard normal number.
        period: of the control step (s).
        share: how far the moment rises in a step, 1 - exp(-period / rise).
    Returns:
        The moment (N m), and the state after the step.
    """
    kept = math.exp(-period / WANDER_S)
    wander = kept * state.wander + math.sqrt(1.0 - kept * kept) * normal
    cut = where(wander > FARTHEST_WANDER, FARTHEST_WANDER, wander)
    cut = where(cut < -FARTHEST_WANDER, -FARTHEST_WANDER, cut)
    drive = state.drive + share * (wish * (1.0 + operator.unsteadiness * cut) - state.drive)
    turns = operator.tremor_phase + operator.tremor_rate * time
    sine, _ = sine_cosine(turns - floor(turns))
    moment = drive * (1.0 + operator.tremor * sine) + operator.stiffness * away
    full = operator.strength * knee_share(coming)
    able = state.freshness * full
    moment = where(moment > able, able, moment)
    moment = where(moment < 0.0, 0.0, moment)
    # Where there is no strength at all nothing is asked of it.
    used = moment / where(full > 0.0, full, 1.0)
    freshness = state.freshness * (1.0 - period * operator.fatigue * used)
    return moment, OperatorState(drive, wander, freshness)


def unsteady(count: Any, stream: Any, key: tuple[Any, Any], zero: Any) -> Any:  # noqa: ANN401
    """A standard normal number of a control step.

    Args:
        count: control steps since the trial began, an integer.
        stream: word of the episode.
        key: the environment's two words.
        zero: the integer 0 of the same kind.
    """
    return normals(philox((count, stream, zero + OWN_STREAM, zero), key))[0]


def _clipped_to(value: Any, width: Any) -> Any:  # noqa: ANN401
    return where(value < 0.0, 0.0, where(value > width, width, value))
