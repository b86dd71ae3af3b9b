"""The same forces by MuJoCo's inverse dynamics: its friction loss, damping, springs and tendons."""

import numpy as np

from benchmarks.hidden_effects.rigs.laws import HiddenEffect
from benchmarks.hidden_effects.rigs.rig import ImposedRig, Reference, Rig
from benchmarks.hidden_effects.rigs.simulators.mujoco_axis import World, mujoco

Array = np.ndarray

STEP = 1e-6
"""Step whose hardness friction has (s)."""

CREEP = 1e-3
"""Speed at which a machine that dwells still goes on as it came, over the largest."""

TURNS = 1e-5
"""Way back after which friction has turned round, over half of the stroke: contacts deflect, and no
record of a machine tells less."""


def simulate(
    rig: ImposedRig, effects: tuple[HiddenEffect, ...], motion: Reference, pressure: float
) -> Array:
    """Force of the drive (N), shape (rows,); as `imposed_force.simulate`."""
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
    creeping = _creeping(motion, CREEP * rig.peak_speed, TURNS * rig.travel)
    rows = zip(motion.q.tolist(), creeping.tolist(), motion.a.tolist(), strict=True)
    forces = np.array([world.inverse(q, v, a, pressure) for q, v, a in rows])
    return forces - rig.damping * (creeping - motion.v) + rig.area * pressure


def _creeping(motion: Reference, creep: float, back: float) -> Array:
    """Speeds of which none but those before the first move is 0: friction keeps its direction."""
    used, last, farthest = motion.v.copy(), 0.0, float(motion.q[0])
    for i, (q, speed) in enumerate(zip(motion.q.tolist(), motion.v.tolist(), strict=True)):
        if abs(q - farthest) > back or last * (q - farthest) > 0.0:
            last = 1.0 if q > farthest else -1.0
            farthest = q
        if abs(speed) < creep or last * speed < 0.0:
            used[i] = creep * last
    return used
