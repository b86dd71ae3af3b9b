"""A case as the lab's folder: CSV files, dataset.toml and the model that the lab believes in."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.hidden_effects.rigs.rig import Rig

Array = np.ndarray


@dataclass(frozen=True)
class Log:
    """One file.

    Attributes:
        command: of the drive (N, N m), shape (rows,).
        readings: of the position sensor (m, rad), shape (rows,).
    """

    command: Array
    readings: Array


def contents(
    rig: Rig,
    believed: Rig,
    logs: Sequence[Log],
    repeats: Mapping[int, int],
    step: float,
    rms: float,
) -> dict[str, str]:
    """Texts of the folder's files by name.

    Args:
        rig: the rig.
        believed: as the lab's model has it.
        logs: its files.
        repeats: by number of a file, from 0, the earlier one that it repeats.
        step: that readings are rounded to (m, rad).
        rms: of the sensor's noise (m, rad).
    """
    texts = {_name(i): _table(rig, log, step) for i, log in enumerate(logs)}
    lines = ['title = "Logs of a drive"', 'model = "model.toml"']
    for i in range(len(logs)):
        lines += ["", f'[trials."{_name(i)}"]', f"order = {i + 1}"]
        if i in repeats:
            lines.append(f'repeat_of = "{_name(repeats[i])}"')
    texts["dataset.toml"] = "\n".join(lines) + "\n"
    limit = max(float(np.abs(log.command).max()) for log in logs)
    texts["model.toml"] = MODELS[rig.kind](believed, limit, rms)
    return texts


def _name(i: int) -> str:
    return f"run_{i + 1:02d}.csv"


def _table(rig: Rig, log: Log, step: float) -> str:
    command, position, factor = COLUMNS[rig.kind]
    digits = max(0, math.ceil(-math.log10(step * factor)) + 2)
    smallest = float(np.abs(log.command).max()) or 1.0
    places = max(0, math.ceil(-math.log10(smallest)) + 6)
    sign = -1.0 if rig.kind == "slide" else 1.0
    rows = [f"time_s,{command},{position}"]
    for i, (u, q) in enumerate(zip(sign * log.command, factor * log.readings, strict=True)):
        rows.append(f"{i / rig.rate:.7g},{u + 0.0:.{places}f},{q + 0.0:.{digits}f}")
    return "\n".join(rows) + "\n"


COLUMNS = {
    "slide": ("load_command_n", "contraction_mm", 1e3),
    "joint": ("torque_n_m", "angle_rad", 1.0),
}
"""Command, position, and the position's unit in SI units, by kind of rig."""


def _slide(rig: Rig, limit: float, rms: float) -> str:
    """Of a slide on a rigid drive; it has no key for a spring."""
    return f"""schema = 1
name = "lab"
title = "What the lab believes"
plant = "slide"

[two_way_drive]
gain_n_per_v = {_number(1.2 * limit / 5.0)}
middle_v = 5

[slide]
mass_kg = {_number(rig.inertia)}

[symmetric_damping]
intercept_n_s_per_mm = {_number(rig.damping / 1e3)}
slope_n_s_per_mm_per_kpa = 0.0

[start]
contraction_mm = 0.0
velocity_mm_per_s = 0.0

[lvdt]
bandwidth_hz = 1e5
noise_mm = {_number(1e3 * rms)}
"""


MODELS = {"slide": _slide}
"""Text of a model by kind of rig."""


def _number(value: float) -> str:
    return f"{value:.7g}"
