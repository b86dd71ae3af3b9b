"""Tables I2 and I3 as trials: commands of known excitation, readings at a few instants.

I3, a trial a row: settled at a pressure with no load; the motor's voltage rises for 5 s, holds for
5 s, falls for 5 s. Contraction and rotation are read before the load, at 10 s and at 15 s, load and
pressure at 10 s; three repeats in order. A zero is free in every trial, so these do not tell how
far the muscle contracts before the load. That takes trials of its own: the no-load contractions of
one load and repeat, read from pressure to pressure with one zero.

I2: a load held while the regulator steps; its contraction counts from a zero of its own, so one
reading a trial tells nothing of contraction, and its "actual" pressure is what is left.
"""

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from benchmarks.identification.statics import StationLimits, station_limits
from pma_gym.data.datasets.dataset import Dataset, NamedTrial
from pma_gym.data.serres2008 import load_table
from pma_gym.data.trial import Trial
from pma_gym.units import SI_FACTORS

WALK_S = 10.0
"""How long each pressure of a walk without load is given (s): a second to get there, and so long to
settle that no pace of anything shows in what is read."""

RAMP_S, READ_S, END_S = 5.0, 10.0, 15.0
"""When I3's load is up, when it is read and begins to fall, and when it is gone (s)."""

STEP_S = 5.0
"""When I2's contraction is read (s)."""

TITLE = "Serres 2008, tables I2 and I3"


def measured_dataset(
    pressures_kpa: Sequence[float] | None = None,
    loads_n: Sequence[float] | None = None,
    repeats: Sequence[int] | None = None,
    steps: int = 1,
) -> Dataset:
    """Trials of the two tables.

    Args:
        pressures_kpa: nominal pressures (kPa) that are taken; all if not given.
        loads_n: nominal loads (N) of I3 that are taken; all if not given.
        repeats: which of I3's repeats are taken, 1 to 3; all if not given.
        steps: every how many of I2's rows are taken; 0 takes none.
    Returns:
        I3's trials, then I2's, then I3's no-load contractions.
    """
    trials = [
        *_limits(pressures_kpa, loads_n, repeats),
        *_steps(pressures_kpa, steps),
        *_walks(pressures_kpa, loads_n, repeats),
    ]
    return Dataset(TITLE, "serres2008", tuple(trials))


def _limits(
    pressures_kpa: Sequence[float] | None,
    loads_n: Sequence[float] | None,
    repeats: Sequence[int] | None,
) -> list[NamedTrial]:
    """Trials of I3."""
    table, data = load_table("I3"), station_limits()
    trials: list[NamedTrial] = []
    firsts: dict[str, str] = {}
    for row, repeat in enumerate(_repeats()):
        pressure = float(table["pressure_nominal_kpa"][row])
        load = float(table["load_nominal_n"][row])
        if not (
            _among(pressure, pressures_kpa) and _among(load, loads_n) and _among(repeat, repeats)
        ):
            continue
        stem = f"I3_{pressure:.0f}kPa_{load:.0f}N"
        first = firsts.setdefault(stem, f"{stem}_{repeat}.csv")
        name = f"{stem}_{repeat}.csv"
        trials.append(
            NamedTrial(
                name,
                limit_trial(data, row),
                # How many trials of this load the muscle has made since it rested.
                float(repeat - 1),
                None if name == first else first,
            )
        )
    return trials


def _repeats() -> list[int]:
    """Which repeat each row of I3 is, 1 to 3: they stand in order."""
    table = load_table("I3")
    counts: Counter[tuple[float, float]] = Counter()
    repeats = []
    for both in zip(table["pressure_nominal_kpa"], table["load_nominal_n"], strict=True):
        counts[both] += 1
        repeats.append(counts[both])
    return repeats


def limit_trial(data: StationLimits, row: int) -> Trial:
    """One row of table I3 as a trial."""
    start, missing = data.no_load[row], np.nan
    pulled, turned = start - data.extension[row], data.rotation[row]
    return _trial(
        np.array([0.0, RAMP_S, READ_S, END_S]),
        {
            "motor_voltage": data.motor_voltage[row] * np.array([0.0, 1.0, 1.0, 0.0]),
            "regulator_voltage": 4 * [data.regulator_voltage[row]],
        },
        {
            "contraction": [start, missing, pulled, pulled + data.returned[row]],
            "rotation": [0.0, missing, turned, turned - data.returned_rotation[row]],
            "load": [missing, missing, data.load[row], missing],
            "pressure": [missing, missing, data.read_pressure[row], missing],
        },
        "table I3",
    )


def _walks(
    pressures_kpa: Sequence[float] | None,
    loads_n: Sequence[float] | None,
    repeats: Sequence[int] | None,
) -> list[NamedTrial]:
    """No-load contractions of I3's rows of one load and repeat, from pressure to pressure."""
    table, data = load_table("I3"), station_limits()
    sessions: dict[tuple[float, int], list[int]] = {}
    for row, repeat in enumerate(_repeats()):
        load = float(table["load_nominal_n"][row])
        if (
            _among(float(table["pressure_nominal_kpa"][row]), pressures_kpa)
            and _among(load, loads_n)
            and _among(repeat, repeats)
        ):
            sessions.setdefault((load, repeat), []).append(row)
    first = min((repeat for _, repeat in sessions), default=1)
    return [
        NamedTrial(
            f"I3_noload_{load:.0f}N_{repeat}.csv",
            _walk(data.regulator_voltage[rows], data.no_load[rows]),
            float(repeat - 1),
            None if repeat == first else f"I3_noload_{load:.0f}N_{first}.csv",
        )
        for (load, repeat), rows in sessions.items()
    ]


def _walk(volts: np.ndarray, contraction: np.ndarray) -> Trial:
    """A walk through regulator voltages (V) with the contraction read settled at each (m)."""
    at = WALK_S * np.arange(len(volts))
    # Each pressure is reached a second after the one before was read.
    time = np.sort(np.concatenate([at, at[:-1] + 1.0]))
    row = np.searchsorted(at, time)
    read = np.isin(time, at)
    return _trial(
        time,
        {"motor_voltage": np.zeros(len(time)), "regulator_voltage": volts[row]},
        {"contraction": np.where(read, contraction[row], np.nan)},
        "table I3, no-load contraction",
    )


def _steps(pressures_kpa: Sequence[float] | None, every: int) -> list[NamedTrial]:
    """Trials of I2, from when the muscle has settled at its load and pressure."""
    if not every:
        return []
    table, limits = load_table("I2"), load_table("I3")
    nominal = np.unique(limits["pressure_nominal_kpa"])
    trials = []
    for row in range(0, len(table["pressure_kpa"]), every):
        read = float(table["pressure_kpa"][row])
        # Read 1.016 P + 3.4 kPa, in steps of 25 kPa or more.
        pressure = float(nominal[np.argmin(np.abs(nominal - (read - 3.4) / 1.016))])
        if not _among(pressure, pressures_kpa):
            continue
        load = float(table["load_n"][row])
        volts = limits.where(pressure_nominal_kpa=pressure)["regulator_voltage_v"][0]
        trials.append(
            NamedTrial(
                f"I2_{pressure:.0f}kPa_{load:.0f}N_{row}.csv",
                _trial(
                    np.array([0.0, STEP_S]),
                    {"load_command": 2 * [load], "regulator_voltage": 2 * [volts]},
                    {
                        "contraction": [
                            np.nan,
                            table["contraction_mm"][row] * SI_FACTORS["mm"],
                        ],
                        "pressure": [np.nan, read * SI_FACTORS["kPa"]],
                    },
                    "table I2",
                ),
                # Not told; what a muscle's rest changes does not reach its pressure.
                order=0.0,
            )
        )
    return trials


def _trial(
    time: np.ndarray,
    commands: Mapping[str, ArrayLike],
    measurements: Mapping[str, ArrayLike],
    table: str,
) -> Trial:
    """A trial of some numbers (SI), NaN where nothing was read."""
    return Trial(
        np.asarray(time, float),
        {name: np.asarray(values, float) for name, values in commands.items()},
        {name: np.asarray(values, float) for name, values in measurements.items()},
        provenance={"source": f"Serres 2008, {table}"},
    )


def _among(value: float, chosen: Sequence[float] | None) -> bool:
    return chosen is None or value in chosen
