"""The force that an imposed motion takes, row by row: what sticks is a spring between two slips.

A part with dry friction sits behind a stiff spring. Where the spring's force reaches the level of
friction the part slips along. This is exact where the motion is monotone between rows.
"""

import numpy as np

from benchmarks.hidden_effects.rigs.laws import HiddenEffect, summed
from benchmarks.hidden_effects.rigs.rig import ImposedRig, Reference

Array = np.ndarray

PRESLIDING = 5e-4
"""Travel in which a stuck part's spring reaches the level of friction, in half strokes."""


def simulate(
    rig: ImposedRig, effects: tuple[HiddenEffect, ...], motion: Reference, pressure: float
) -> Array:
    """Force of the drive (N), shape (rows,).

    Args:
        rig: the rig.
        effects: what it hides.
        motion: that the drive imposes.
        pressure: in the file (Pa).
    """
    extra, kinetic, _ = summed(effects)
    force = rig.mass * motion.a + rig.damping * motion.v + rig.stiffness * motion.q
    force += rig.area * pressure
    moves = list(zip(motion.q.tolist(), motion.v.tolist(), strict=True))
    # A law pushes the axis; the drive pushes against it.
    force -= [extra(q, v, pressure) for q, v in moves]
    return force + _dry([(q, kinetic(q, v, pressure)) for q, v in moves], rig.travel)


def _dry(levels: list[tuple[float, float]], travel: float) -> Array:
    part, forces = levels[0][0], []
    reach = PRESLIDING * travel
    for q, level in levels:
        away = q - part
        share = min(abs(away) / reach, 1.0)
        if abs(away) > reach:
            part = q - reach * (1.0 if away > 0.0 else -1.0)
        forces.append(level * share * (1.0 if away > 0.0 else -1.0))
    return np.array(forces)
