"""The same forces by MuJoCo's inverse dynamics: its friction loss, damping, springs and tendons."""

import numpy as np

from benchmarks.hidden_effects.rigs.excitation import Reference
from benchmarks.hidden_effects.rigs.imposed_rig import ImposedRig
from benchmarks.hidden_effects.rigs.laws import HiddenEffect
from benchmarks.hidden_effects.rigs.rig import Rig
from benchmarks.hidden_effects.rigs.simulators.mujoco_axis import World, mujoco

Array = np.ndarray

STEP = 1e-6
"""Step whose hardness friction has (s)."""

CREEP = 1e-3
"""Speed at which a machine that dwells still goes on as it came, over the largest."""


def simulate(
    rig: ImposedRig, effects: tuple[HiddenEffect, ...], motion: Reference, pressure: float
) -> Array:
    """Force of the drive (N), shape (rows,); as `imposed_force.simulate`, without a play."""
    slide = Rig(
        "slide",
        rig.mass + 0.5 * STEP * rig.damping,
        rig.damping,
        rig.stiffness,
        0.0,
        0.0,
        rig.travel,
        rig.frequency,
        rig.rate,
    )
    world = World(mujoco(), slide, effects, STEP)
    creeping = _creeping(motion.v, CREEP * rig.peak_speed)
    rows = zip(motion.q.tolist(), creeping.tolist(), motion.a.tolist(), strict=True)
    forces = np.array([world.inverse(q, v, a, pressure) for q, v, a in rows])
    return forces - rig.damping * (creeping - motion.v) + rig.area * pressure


def _creeping(speeds: Array, creep: float) -> Array:
    """Speeds of which none but those before the first move is 0: friction keeps its direction."""
    used, last = speeds.copy(), 0.0
    for i, speed in enumerate(speeds.tolist()):
        if abs(speed) > creep:
            last = 1.0 if speed > 0.0 else -1.0
        elif last:
            used[i] = creep * last
    return used
