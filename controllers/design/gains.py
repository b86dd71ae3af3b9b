"""Gains by model, loop, task, controller and pressure, as `benchmarks.tuning.tune` writes them."""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from controllers.design.designs import (
    kept_settings,
    loop_name,
    must_give_a_position,
    nearest_loop,
    task_kind,
    warn_of_other_plant,
)
from pma_gym.data.signals import SIGNALS
from pma_gym.envs import StationInfo
from pma_gym.units import SI_FACTORS

GAINS_FILE = Path(__file__).with_name("gains.toml")
"""The gains of the controllers here, with where they come from."""

SCHEMA = 3

START_SHARE = 0.2
"""Share of the range over which `Gains.start_factor` fades out."""


class Gains(NamedTuple):
    """Gains of a PID in SI: m or rad, V, s.

    Attributes:
        proportional: k_p (V/m or V/rad).
        integral: k_i (V/(m s) or V/(rad s)).
        derivative: k_d (V s/m or V s/rad).
        filter: time constant of the derivative's filter, tau_f (s).
        lead: how far ahead of its time the reference is followed (s).
        end_factor: factor on k_p, k_i and k_d at the end of the task's range.
        start_factor: factor on k_p and k_d at its start, its root on k_i.
    """

    proportional: float
    integral: float
    derivative: float
    filter: float
    lead: float = 0.0
    end_factor: float = 1.0
    start_factor: float = 1.0

    def scaled(self, share: float) -> "Gains":
        """The gains in force where the reference covers this share of its range.

        They grow with the square of the share, to `end_factor`: at low pressure the muscle
        stiffens towards its resting length (at 150 kPa a volt moves it 10 mm at the start of the
        displacement task and 2 mm at its end), so that gains of one value would be too high
        here or too low there.

        Over the first fifth of the range they rise from `start_factor`: as the cable goes slack
        at the end of phase III, every push that noise makes stays, for the drive cannot push
        back and nothing else does. k_p and k_d pass noise on from sample to sample.
        """
        held = min(max(share, 0.0), 1.0)
        end = 1.0 + (self.end_factor - 1.0) * held * held
        start = 1.0 + (self.start_factor - 1.0) * max(0.0, 1.0 - held / START_SHARE)
        return self._replace(
            proportional=end * start * self.proportional,
            integral=end * math.sqrt(start) * self.integral,
            derivative=end * start * self.derivative,
            end_factor=1.0,
            start_factor=1.0,
        )


def column_names(unit: str) -> dict[str, tuple[str, float]]:
    """Names of the gains in the file and their value in SI, for `mm` or `deg`.

    >>> column_names("mm")["integral"]
    ('integral_v_per_mm_s', 1000.0)
    """
    per = 1.0 / SI_FACTORS[unit]
    return {
        "proportional": (f"proportional_v_per_{unit}", per),
        "integral": (f"integral_v_per_{unit}_s", per),
        "derivative": (f"derivative_v_s_per_{unit}", per),
        "filter": ("filter_s", 1.0),
        "lead": ("lead_s", 1.0),
        "end_factor": ("end_factor", 1.0),
        "start_factor": ("start_factor", 1.0),
    }


def scheduled_gains(controller: str, station: StationInfo, path: Path = GAINS_FILE) -> Gains:
    """Gains of a controller for a station, linear between the tuned pressures.

    Gains are of a loop (control rate and delay) and of a kind of task: any reference in extension
    is followed with those of the displacement task. A loop that was not tuned takes those of the
    one that is nearest in dead time.

    Args:
        controller: `pid` or `feedforward_pid`.
        station: its model, task, pressure, period and delays.
        path: file of gains.
    Returns:
        The gains in SI: those tuned on the model of this name, else those of the shipped model
        of the same plant; below and above the tuned pressures those of the nearest.
    Raises:
        ValueError: there are none, or the task is an exercise, which has no position to follow.
    """
    models = kept_settings(path, SCHEMA, "tune")
    must_give_a_position(station)
    model, task, kind = station.model, station.task, task_kind(station)
    name = model.name if model.name in models else model.plant
    loops = models.get(name, {})
    known = [loop for loop, kinds in loops.items() if controller in kinds.get(kind, {})]
    if not known:
        raise ValueError(
            f"{path.name} has no gains of {controller} for the {task.name} task on a "
            f"{model.plant}; tune them: python -m benchmarks tune --model {name}"
        )
    tune = "python -m benchmarks tune --model FILE.toml --out gains.toml"
    mine = f'scheduled_gains("{controller}", env.station, Path("gains.toml"))'
    fix = f"tune its own: {tune}, and give the controller {mine} of controllers.design.gains"
    warn_of_other_plant(station, f"the gains of {controller}", name, fix)
    table = loops[nearest_loop(loop_name(station), known)][kind][controller]
    columns = column_names(_unit(task.schedule.quantity))
    pressures = np.array(table["pressure_kpa"]) * 1e3
    return Gains(
        *(
            float(np.interp(station.pressure, pressures, table[column])) * factor
            for column, factor in (columns[field] for field in Gains._fields)
        )
    )


def _unit(quantity: str) -> str:
    return "deg" if SIGNALS[quantity].is_angle else "mm"
