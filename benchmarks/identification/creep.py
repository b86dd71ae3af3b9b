"""Test for creep of the station: I3's load cycle with a fast branch, on left-out pressures.

Load cycle of I3 at the pace of its ramps, quasi-static but for what is viscous: with F(P, x) the
static force, H z the hysteresis, B the damping, f the force in the branch (`effects.creep`),

    F(P, x) - H z - f - B x' = load,    f' = c x' - f / tau

integrated in equal parts of each 5 s by the implicit rule that is exact for a constant speed within
a part. It begins settled: f = 0, z as the model's trials begin.

The rule, fixed before any trial of tables 20-30 is replayed: creep joins the model if the 95 %
interval of its stiffness (jackknife over pressures) excludes 0 and if it lowers the squared misfit
at left-out pressures, over all pressures in turn, by more than chance would (paired Student's t,
two-sided 95 %). Tables 20-30 take no part. A load cycle has one pace, which tells a stiffness at a
given time constant and not both: the time constant is the literature's.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from benchmarks.identification.statics import RAMP_S, LoadCycleReadings
from benchmarks.identification.transients import damping_of
from pma_gym.plant.model import Model
from pma_gym.plant.statics import contraction_at, muscle_force

CREEP: dict[str, tuple[float, float]] = {"creep.stiffness_n_per_mm": (0.3, 0.2)}
"""What is fitted of the branch: where the fit starts, and the scale of a step."""

HELD = {"creep.stiffness_n_per_mm": 0.3, "creep.time_constant_s": 2.0}
"""The branch before a fit; its time constant is the literature's, 1-3 s."""

PARTS = 20
"""Parts of each 5 s: twice as many move no figure by more than 0.01 mm."""

STUDENT_10 = 2.228
"""97.5 % point of Student's t with 10 degrees of freedom: 11 pressures left out in turn."""

ROUNDS = 4
"""Newton's rounds for a part; the force is smooth, and the part before is a close start."""

_STEP = 1e-6


class Branch(NamedTuple):
    """The branch of creep: stiffness c (N/m), time constant tau (s)."""

    stiffness: float
    time_constant: float


def branch_of(model: Model) -> Branch:
    """A model's quick branch of creep; of no stiffness where it has none."""
    creep = model.parameters.get("creep")
    return Branch(0.0, 1.0) if creep is None else Branch(creep.stiffness, creep.time_constant)


def load_cycle_with_creep(
    model: Model, pressure: np.ndarray, load: np.ndarray
) -> LoadCycleReadings:
    """Predict I3's load cycle by a model with a branch of creep.

    Args:
        model: a station's model with hysteresis and damping, and creep or none.
        pressure: gauge pressures (Pa), shape (n,).
        load: loads at 10 s (N), shape (n,).
    """
    quasi_static = _QuasiStatic(model, pressure)
    x0 = quasi_static.contraction.copy()
    shares = np.arange(1, PARTS + 1) / PARTS
    for share in shares:
        quasi_static.part(share * load, -1.0)
    for _ in shares:
        quasi_static.part(load, -1.0)
    x1 = quasi_static.contraction.copy()
    for share in shares:
        quasi_static.part((1.0 - share) * load, 1.0)
    return LoadCycleReadings(x0, x0 - x1, quasi_static.contraction - x1)


class CreepFold(NamedTuple):
    """Result of the test for creep at a left-out pressure.

    Attributes:
        stiffness: of the branch, fitted without that pressure (N/mm).
        without: mean weighted square of what a fit without creep misses at that pressure.
        with_creep: the same with creep.
    """

    stiffness: float
    without: float
    with_creep: float


class Decision(NamedTuple):
    """Decision for or against creep, with the reason in words."""

    asked: bool
    text: str


def decided(folds: Sequence[CreepFold]) -> Decision:
    """Decide by eleven left-out pressures whether the model needs creep, by the rule above."""
    stiffness, without, with_creep = np.array(folds).T
    count = len(folds)
    error = np.sqrt((count - 1) / count * np.sum((stiffness - stiffness.mean()) ** 2))
    low, high = stiffness.mean() - STUDENT_10 * error, stiffness.mean() + STUDENT_10 * error
    gain = without - with_creep
    least = gain.mean() - STUDENT_10 * gain.std(ddof=1) / np.sqrt(count)
    asked = bool(low > 0.0 and least > 0.0)
    return Decision(
        asked,
        f"creep (2 s): {'asked for' if asked else 'not asked for'}; fitted {stiffness.mean():.2f} "
        f"N/mm ({max(low, 0.0):.2f} to {high:.2f}), and the squared misfit at left-out pressures "
        f"goes from {without.mean():.3f} to {with_creep.mean():.3f}",
    )


class _QuasiStatic:
    """Muscles at their pressures, from part to part."""

    def __init__(self, model: Model, pressure: np.ndarray) -> None:
        self.pressure, self.force = pressure, muscle_force(model)
        self.hysteresis, self.damping = model.parameters["hysteresis"], damping_of(model, pressure)
        branch, self.length = branch_of(model), RAMP_S / PARTS
        self.kept = np.exp(-self.length / branch.time_constant)
        # Force that a part of one metre a second adds to the branch.
        self.added = branch.stiffness * branch.time_constant * (1.0 - self.kept)
        memory = self.hysteresis.memory_at_start
        hysteresis_force = np.full_like(pressure, self.hysteresis.force * memory)
        self.contraction = contraction_at(self.force, pressure, hysteresis_force)
        self.memory, self.branch = np.full_like(pressure, memory), np.zeros_like(pressure)

    def part(self, load: np.ndarray, direction: float) -> None:
        """Go on for one part, to a load (N), in a direction of travel (1: contraction)."""
        x = self.contraction.copy()
        for _ in range(ROUNDS):
            here = self._left(x, load, direction)
            slope = (self._left(x + _STEP, load, direction) - here) / _STEP
            x = x - here / slope
        self.memory = self._memory(x, direction)
        self.branch = self._branch(x)
        self.contraction = x

    def _left(self, x: np.ndarray, load: np.ndarray, direction: float) -> np.ndarray:
        viscous = self.damping * (x - self.contraction) / self.length
        hysteretic = self.hysteresis.force * self._memory(x, direction)
        return self.force(self.pressure, x) - hysteretic - self._branch(x) - viscous - load

    def _branch(self, x: np.ndarray) -> np.ndarray:
        return self.kept * self.branch + self.added * (x - self.contraction) / self.length

    def _memory(self, x: np.ndarray, direction: float) -> np.ndarray:
        travel = np.maximum(direction * (x - self.contraction), 0.0)
        return direction + (self.memory - direction) * np.exp(-travel / self.hysteresis.distance)
