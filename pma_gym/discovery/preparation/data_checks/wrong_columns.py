"""Columns in another unit, and what to write in `dataset.toml` to correct them."""

from collections.abc import Sequence

import numpy as np

from pma_gym.data.datasets.dataset import Dataset, NamedTrial
from pma_gym.data.signals import SIGNALS
from pma_gym.data.trial import Trial
from pma_gym.data.trial_columns import BY_QUANTITY
from pma_gym.discovery.preparation.data_checks.clock import wrong_clock
from pma_gym.discovery.preparation.data_checks.pressure_level import Level, pressure_level
from pma_gym.discovery.preparation.data_checks.proposals import instruction, lines
from pma_gym.discovery.preparation.data_checks.simulated import ATMOSPHERE, Pair, pairs
from pma_gym.discovery.preparation.data_checks.units import (
    ABSOLUTE,
    MOTION_UNITS,
    Unit,
    motion_unit,
    pressure_unit,
    slope_of,
)
from pma_gym.discovery.thresholds import FAR_ZERO_M, PRESSURE_FAR
from pma_gym.plant.model import Model

COMMAND_OF = {"load": "load_command", "pressure": "pressure_command"}


def clock_proposals(dataset: Dataset, named: Sequence[NamedTrial], model: Model) -> list[str]:
    """What to say of a clock that cannot be in seconds; nothing of one that may be."""
    wrong_factor = wrong_clock(named, model)
    if wrong_factor is None:
        return []
    said, factor = wrong_factor
    if not factor:
        return [f"{said}; give time_s in seconds"]
    return [f"{said}; {_how(dataset, [each.name for each in named], 'time', factor)}"]


def unit_proposals(dataset: Dataset, named: Sequence[NamedTrial], model: Model) -> list[str]:
    """What to say of every signal that is certainly in another unit, with the lines to write."""
    trials = [each.trial for each in named]
    simulated = pairs(model, trials)
    said = []
    for quantity in MOTION_UNITS:
        said += _of_motion(dataset, named, simulated, quantity)
    unit = pressure_unit(simulated)
    if unit is not None:
        said.append(_of_pressure(dataset, named, simulated, unit))
    elif (level := pressure_level(model, trials)) is not None:
        said.append(_of_both(dataset, named, level))
    return said


def _of_motion(
    dataset: Dataset, named: Sequence[NamedTrial], simulated: Sequence[Pair], quantity: str
) -> list[str]:
    """Of contraction, rotation or load: which trials have it in which unit."""
    unit_of = {
        pair.number: motion_unit(quantity, pair) for pair in simulated if slope_of(pair, quantity)
    }
    said = []
    for unit in dict.fromkeys(unit for unit in unit_of.values() if unit is not None):
        numbers = [number for number, other in unit_of.items() if other == unit]
        right = [number for number, other in unit_of.items() if other is None]
        slopes = [slope_of(pair, quantity) for pair in simulated if pair.number in numbers]
        slope = float(np.median([each.slope for each in slopes if each is not None]))
        name = BY_QUANTITY[quantity].name
        seen = f"{name} is {slope:.3g} times what model and commands give"
        if unit.command:
            command = BY_QUANTITY[COMMAND_OF[quantity]].name
            seen += f": {command} is in {unit.words}"
        else:
            seen += f": {unit.words}"
        if not right:
            zero = _zero(quantity, unit, [pair for pair in simulated if pair.number in numbers])
            said.append(f"{seen}; {_for_unit(dataset, named, quantity, unit, zero)}")
        elif len(numbers) >= len(right):
            files = [named[number].name for number in numbers]
            said.append(f"{seen}, in {', '.join(files)}; {_renamed(name, unit)}")
    return said


def _renamed(name: str, unit: Unit) -> str:
    """What to do where only some files are in another unit."""
    other = f"{name}_2"
    line = f'"{other}" = {{ name = "{name}", factor = {1.0 / unit.factor:.7g} }}'
    return f"rename the column to {other} there, and under [columns] of dataset.toml write: {line}"


def _for_unit(
    dataset: Dataset, named: Sequence[NamedTrial], quantity: str, unit: Unit, zero: float = 0.0
) -> str:
    """How to correct a column that all files have in a unit, and from another zero (SI)."""
    names = [each.name for each in named]
    if unit.command:
        return _how(dataset, names, COMMAND_OF[quantity], unit.factor)
    return _how(dataset, names, quantity, 1.0 / unit.factor, zero - unit.offset / unit.factor)


def _zero(quantity: str, unit: Unit, simulated: Sequence[Pair]) -> float:
    """What a corrected contraction is to be moved by (m): 0 unless it is far from a muscle's.

    Its zero is free in every trial, so a whole millimetre will do.
    """
    if not SIGNALS[quantity].shortens:
        return 0.0
    signals = [pair.signal(quantity)[1:] for pair in simulated]
    away = float(np.median([np.median(s) - np.median(m) / unit.factor for s, m in signals]))
    return round(1e3 * away) * 1e-3 if abs(away) > FAR_ZERO_M else 0.0


def _of_pressure(
    dataset: Dataset, named: Sequence[NamedTrial], pairs: Sequence[Pair], unit: Unit
) -> str:
    column, command = BY_QUANTITY["pressure"], BY_QUANTITY["pressure_command"]
    levels = [pair.signal("pressure")[1:] for pair in pairs]
    simulated = np.concatenate([each[0] for each in levels])
    measured = np.concatenate([each[1] for each in levels])
    names = [each.name for each in named]
    if unit.offset and unit.factor == 1.0:
        above = float(np.median(measured - simulated)) / 1e3
        if not unit.command:
            return (
                f"{column.name} reads {above:.4g} kPa above its command at rest: absolute "
                f"pressure; {_how(dataset, names, 'pressure', 1.0, -ATMOSPHERE)}"
            )
        return (
            f"{column.name} reads {-above:.4g} kPa below its command at rest: the command is an "
            f"absolute pressure; {_how(dataset, names, 'pressure_command', 1.0, -ATMOSPHERE)}"
        )
    share = float(np.median(measured / np.where(simulated == 0.0, np.nan, simulated)))
    seen = f"{column.name} is {share:.3g} times what its command asks for"
    if unit.command:
        how = _how(dataset, names, "pressure_command", unit.factor)
        return f"{seen}: {command.name} is in {unit.words}; {how}"
    return f"{seen}: {unit.words}; {_for_unit(dataset, named, 'pressure', unit)}"


def _of_both(dataset: Dataset, named: Sequence[NamedTrial], level: Level) -> str:
    """How to correct commanded pressures, and measured ones that agree with them."""
    names, unit = [each.name for each in named], level.unit
    quantities = ["pressure_command", "pressure"]
    if not any(_agree(each.trial) for each in named):
        quantities.pop()
    columns = " and ".join(BY_QUANTITY[each].name for each in quantities)
    said = "both read" if len(quantities) > 1 else "reads"
    (low, high), (lowest, highest) = level.commanded, level.valid
    seen = (
        "101.3 kPa above gauge pressure"
        if unit == ABSOLUTE
        else f"{low / 1e3:.3g} to {high / 1e3:.3g} kPa, where the model holds from "
        f"{lowest / 1e3:.3g} to {highest / 1e3:.3g} kPa"
    )
    given = f"not {1e3 * level.given:.2g} mm"
    before = given if np.isfinite(level.given) else "and cannot follow them now"
    written: dict[str, str] = {}
    for quantity in quantities:
        offset = -unit.offset / unit.factor
        written |= lines(dataset, names, quantity, 1.0 / unit.factor, offset)
    return (
        f"{columns} {said} {seen}: {unit.words} (corrected, the model misses contraction by "
        f"{1e3 * level.corrected:.2g} mm, {before}); {instruction(written, dataset.columns)}"
    )


def _agree(trial: Trial) -> bool:
    """Whether measured pressures are what the commands ask for, most of the time."""
    measured, command = trial.measurements.get("pressure"), trial.commands["pressure_command"]
    if measured is None:
        return False
    return bool(np.nanmedian(np.abs(measured - command)) < PRESSURE_FAR * np.median(command))


def _how(
    dataset: Dataset, names: Sequence[str], quantity: str, factor: float, offset: float = 0.0
) -> str:
    written = lines(dataset, names, quantity, factor, offset)
    return instruction(written, dataset.columns)
