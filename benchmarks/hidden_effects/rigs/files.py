"""A case as the lab's folder: CSV files, dataset.toml and the model that the lab believes in."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from benchmarks.hidden_effects.rigs.rig import ImposedRig, Rig


@dataclass(frozen=True)
class LabNames:
    """A lab's names of columns: ours = factor * theirs.

    Attributes:
        time: name of the time.
        second: seconds of its unit.
        columns: name and factor by our name; where one is missing it has our name.
    """

    time: str = "time_s"
    second: float = 1.0
    columns: Mapping[str, tuple[str, float]] = field(default_factory=dict)

    def of(self, column: str) -> tuple[str, float]:
        """Name and factor of a column."""
        return self.columns.get(column, (column, 1.0))

    def decimals(self, column: str, places: int) -> int:
        """Of values that have so many in our unit."""
        _, factor = self.of(column)
        return max(0, places + math.ceil(math.log10(abs(factor))))

    def lines(self, columns: list[str]) -> list[str]:
        """Of dataset.toml."""
        if self == LabNames():
            return []
        lines = ["", "[columns]", f'{self.time} = {{ name = "time_s", factor = {self.second:g} }}']
        for ours in columns:
            name, factor = self.of(ours)
            lines.append(f'{name} = {{ name = "{ours}", factor = {factor:g} }}')
        return lines


OURS = LabNames()

METRES = LabNames(
    "t", 1.0, {"load_command_n": ("F_drive", -1.0), "contraction_mm": ("x_m", 1000.0)}
)
"""SI, with a force that is positive where the position grows."""

GERMAN = LabNames(
    "Zeit_ms",
    0.001,
    {"load_command_n": ("Kraft_kN", 1000.0), "contraction_mm": ("Weg_um", 0.001)},
)


def draw_names(rng: np.random.Generator) -> LabNames:
    """Ours in three of five labs."""
    return (OURS, OURS, OURS, METRES, GERMAN)[int(rng.integers(5))]


Array = np.ndarray

Table = Mapping[str, tuple[Array, int]]
"""Columns of a file by name: values, shape (rows,), and decimals."""


def folder(
    rate: float,
    tables: Sequence[Table],
    repeats: Mapping[int, int],
    model: str,
    tolerance: Mapping[str, float],
    names: LabNames = OURS,
) -> dict[str, str]:
    """Texts of a data set's files by name.

    Args:
        rate: of all files (Hz).
        tables: of the files.
        repeats: by number of a file, from 0, the earlier one that it repeats.
        model: text of the model.
        tolerance: by column, where the lab states one.
        names: that the lab has for its columns.
    """
    texts = {trial_name(i): _csv(rate, table, names) for i, table in enumerate(tables)}
    lines = ['title = "Logs of a drive"', 'model = "model.toml"', *names.lines(list(tables[0]))]
    if tolerance:
        lines += ["", "[tolerance]", *(f"{key} = {_number(x)}" for key, x in tolerance.items())]
    for i in range(len(tables)):
        lines += ["", f'[trials."{trial_name(i)}"]', f"order = {i + 1}"]
        if i in repeats:
            lines.append(f'repeat_of = "{trial_name(repeats[i])}"')
    return texts | {"dataset.toml": "\n".join(lines) + "\n", "model.toml": model}


def digits(step: float) -> int:
    """Decimals that a column needs for a step: two more than its own."""
    return max(0, math.ceil(-math.log10(step)) + 2)


def trial_name(i: int) -> str:
    """Name of a file, counted from 0."""
    return f"run_{i + 1:02d}.csv"


def _csv(rate: float, table: Table, names: LabNames) -> str:
    header, columns = [names.time], []
    for ours, (values, places) in table.items():
        name, factor = names.of(ours)
        decimals = names.decimals(ours, places)
        header.append(name)
        # Adding 0 turns -0.0 into 0.0.
        columns.append([f"{value + 0.0:.{decimals}f}" for value in values / factor])
    rows = [",".join(header)]
    for i, cells in enumerate(zip(*columns, strict=True)):
        rows.append(",".join([f"{i / rate / names.second:.9g}", *cells]))
    return "\n".join(rows) + "\n"


WEAKEST = 0.01
"""Least gain that a model file takes (N/V); the line only says how a force is written as volts."""


def _slide(rig: Rig, limit: float) -> str:
    """Of a slide on a rigid drive, which has no key for a spring.

    Nor has it a sensor: one of 100 kHz, the fastest that may be stated, would already be late by a
    hundredth of what an encoder of 50 nm tells.
    """
    return f"""schema = 1
name = "lab"
title = "What the lab believes"
plant = "slide"

[two_way_drive]
gain_n_per_v = {_number(max(1.2 * limit / 5.0, WEAKEST))}
middle_v = 5

[slide]
mass_kg = {_number(rig.inertia)}

[symmetric_damping]
intercept_n_s_per_mm = {_number(rig.damping / 1e3)}
slope_n_s_per_mm_per_kpa = 0.0

[start]
contraction_mm = 0.0
velocity_mm_per_s = 0.0
"""


def _joint(rig: Rig, limit: float) -> str:
    """Of a joint under a torque, with a weight and a spring where the lab knows of them."""
    text = f"""schema = 1
name = "lab"
title = "What the lab believes"
plant = "joint"

[torque_drive]
gain = 1

[inertia]
inertia_kg_m2 = {_number(rig.inertia)}

[joint_damping]
coefficient_n_m_s = {_number(rig.damping)}

[joint_start]
angle_deg = 0.0
spin_deg_per_s = 0.0
"""
    if rig.gravity:
        text += f"""
[joint_weight]
moment_n_m = {_number(rig.gravity)}
offset_deg = {_number(math.degrees(rig.gravity_angle))}
"""
    if rig.stiffness:
        text += f"""
[joint_spring]
stiffness_n_m_per_rad = {_number(rig.stiffness)}
rest_deg = 0.0
"""
    return text


def friction(rig: Rig, level: float, presliding: float) -> str:
    """Table of dry friction to add to the model of a slide or a joint.

    Args:
        rig: the axis.
        level: of the friction (N, N m).
        presliding: distance in which it builds up (m, rad).
    """
    slides = rig.kind == "slide"
    force, speed = ("n", "mm_per_s") if slides else ("n_m", "deg_per_s")
    distance = ("um", 1e6) if slides else ("deg", math.degrees(1.0))
    return f"""
[{"coulomb_friction" if slides else "joint_friction"}]
static_{force} = {_number(level)}
dynamic_{force} = {_number(level)}
stribeck_speed_{speed} = 5
presliding_{distance[0]} = {_number(distance[1] * presliding)}
"""


FASTER = 3.0
"""Bandwidth of what a log records of a motion, over that of the machine that makes it."""


def imposed(rig: ImposedRig) -> str:
    """Text of the model of a part on a testing machine, whose cell is freed of its inertia."""
    text = f"""schema = 1
name = "lab"
title = "What the lab believes"
plant = "imposed"

[imposed_motion]
bandwidth_hz = {_number(FASTER * rig.bandwidth)}

[symmetric_damping]
intercept_n_s_per_mm = {_number(rig.damping / 1e3)}
slope_n_s_per_mm_per_kpa = 0.0
"""
    if rig.area:
        text += f"""
[piston_force]
area_mm2 = {_number(1e6 * rig.area)}
"""
    if rig.stiffness:
        text += f"""
[spring]
stiffness_n_per_mm = {_number(rig.stiffness / 1e3)}
rest_mm = 0.0
"""
    return text


MODELS = {"slide": _slide, "joint": _joint}
"""Text of a model by kind of rig."""


def _number(value: float) -> str:
    return f"{value:.7g}"
