"""Size of a hidden effect: its change of the readings that no refit of the model explains.

    r = rms of that change / rms of the sensor's noise

Along the true motion the lab's model lacks a force d(t). To first order its positions are off by e,

    inertia e'' + damping e' + (stiffness + gravity cos(q + angle)) e = -d(t),

which begins anew in each window, for the model may start where it likes there. What changes of
inertia, damping, stiffness and gravity, and of the start of each window, do the same way is taken
off by least squares; what is left is the change. Windows last a second, or the slowest period of
the reference where that is longer.
"""

import math
from collections.abc import Callable, Mapping

import numpy as np

from benchmarks.hidden_effects.rigs.rig import Rig
from benchmarks.hidden_effects.rigs.simulators.stick_slip import Motion

Values = Mapping[str, float]

KEYS: dict[str, tuple[str, float]] = {
    "coulomb_friction": ("dynamic_n", 1.0),
    "joint_friction": ("dynamic_n_m", 1.0),
    "contact_friction": ("force_n", 1.0),
    "load_dependent_friction": ("drive_share_percent", 100.0),
    "joint_load_friction": ("drive_share_percent", 100.0),
    "joint_weight": ("moment_n_m", 1.0),
    "joint_spring": ("stiffness_n_m_per_rad", 1.0),
    "hardening_spring": ("cubic_n_per_mm3", 1e-9),
    "joint_hardening_spring": ("cubic_n_m_per_rad3", 1.0),
    "quadratic_drag": ("coefficient_n_s2_per_mm2", 1e-6),
    "joint_drag": ("coefficient_n_m_s2", 1.0),
    "directional_damping": ("difference_n_s_per_mm", 1e-3),
    "joint_directional_damping": ("difference_n_m_s", 1.0),
    "directional_gain": ("difference_percent", 100.0),
    "cogging": ("amplitude_n", 1.0),
    "drive_delay": ("delay_ms", 1e3),
    "drive_lag": ("time_constant_ms", 1e3),
}
"""By the catalogue's effect, its parameter that is the hidden law's `size`, and file units in one
of SI."""

OTHERWISE: dict[str, Callable[[Values], dict[str, float]]] = {
    "pressure_friction": lambda p: {"slope_n_per_kpa": 1e3 * p["size"] * p["slope"]},
}
"""Those whose parameter is another."""

TURNED = {("imposed", "directional_damping")}
"""Effects with a direction on rigs whose file counts positions the other way round."""


def expected(
    kind: str, name: str, hidden: Values, beside: Mapping[str, Values] | None = None
) -> dict[str, float]:
    """Values in file units, by the catalogue's parameter, that describe a hidden effect.

    The catalogue's friction by pressure has none without pressure; what the hidden law has there
    adds to the friction of a contact.

    Args:
        kind: of the rig.
        name: the catalogue's name of the effect; one that it lacks has no values.
        hidden: parameters of the hidden law (SI).
        beside: those of all that is hidden, by the catalogue's name.
    """
    seal = (beside or {}).get("pressure_friction")
    if name == "contact_friction" and seal is not None:
        return {"force_n": hidden["size"] + seal["size"]}
    if name in OTHERWISE:
        return OTHERWISE[name](hidden)
    if name not in KEYS:
        return {}
    key, factor = KEYS[name]
    sign = -1.0 if (kind, name) in TURNED else 1.0
    return {key: sign * factor * hidden["size"]}


Array = np.ndarray

WINDOW = 1.0
"""Shortest window (s)."""

SLOWEST = 0.2
"""Slowest part of a reference over the fastest."""


def change(rig: Rig, motion: Motion) -> Array:
    """What the effect changes beyond a refit (m, rad), rows of all windows in turn.

    Args:
        rig: the axis without what it hides.
        motion: of the axis with it.
    """
    rows = round(rig.rate * max(WINDOW, 1.0 / (SLOWEST * rig.frequency)))
    rows = min(rows, len(motion.q))
    columns = _responses(rig, motion, rows, len(motion.q) // rows)
    # (regressors, windows, rows): each window gives up its own starts first.
    effect, known, starts = columns[0], columns[1:-2], columns[-2:]
    basis = np.linalg.qr(starts.transpose(1, 2, 0))[0]
    effect, known = _without(basis, effect), _without(basis, known)
    table = known.reshape(len(known), -1).T
    scales = np.linalg.norm(table, axis=0)
    table = table[:, scales > 1e-9 * scales.max()]
    table = table / np.linalg.norm(table, axis=0)
    values = effect.ravel()
    return values - table @ np.linalg.lstsq(table, values, rcond=1e-10)[0]


def size(changed: Array, noise: float) -> float:
    """Size r of a change."""
    return float(math.sqrt(np.mean(changed**2)) / noise)


def _without(basis: Array, signals: Array) -> Array:
    shares = np.einsum("wrk,...wr->...wk", basis, signals)
    return signals - np.einsum("wrk,...wk->...wr", basis, shares)


def _responses(rig: Rig, motion: Motion, rows: int, count: int) -> Array:
    """Shape (regressors, windows, rows)."""
    q, v, a = motion.q, motion.v, motion.a
    weight = rig.gravity * np.sin(q + rig.gravity_angle)
    lacking = rig.inertia * a + rig.damping * v + rig.stiffness * q + weight - motion.command
    forces = [
        lacking,
        a,
        v,
        q if rig.stiffness else 0.0 * q,
        *([np.sin(q + rig.gravity_angle), np.cos(q)] if rig.gravity else [0.0 * q, 0.0 * q]),
    ]
    shaped = np.array(forces)[:, : count * rows].reshape(len(forces), count, rows)
    stiffness = rig.stiffness + rig.gravity * np.cos(q + rig.gravity_angle)
    stiffness = stiffness[: count * rows].reshape(count, rows)
    return _integrated(rig, shaped, stiffness)


def _integrated(rig: Rig, forces: Array, stiffness: Array) -> Array:
    """Responses to forces from rest, then to a start of 1 and to a speed of 1: trapezoidal rule."""
    kinds, count, rows = forces.shape
    h, zeros = 1.0 / rig.rate, np.zeros((2, count))
    out = np.zeros((kinds + 2, count, rows))
    e, v = np.zeros((kinds + 2, count)), np.zeros((kinds + 2, count))
    e[-2], v[-1] = 1.0, 1.0
    out[:, :, 0] = e
    for k in range(1, rows):
        before = np.concatenate([forces[:, :, k - 1], zeros])
        after = np.concatenate([forces[:, :, k], zeros])
        pull = before + after - stiffness[:, k - 1] * e - rig.damping * v
        # Position by the mean of both speeds, put into the equation of the new speed.
        k_new = stiffness[:, k]
        right = v * rig.inertia + 0.5 * h * (pull - k_new * (e + 0.5 * h * v))
        v_new = right / (rig.inertia + 0.5 * h * rig.damping + 0.25 * h * h * k_new)
        e = e + 0.5 * h * (v + v_new)
        v = v_new
        out[:, :, k] = e
    return out
