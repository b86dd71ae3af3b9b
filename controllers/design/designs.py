"""Settings and gains of the controllers, as `python -m benchmarks design` and `tune` wrote them."""

import math
import re
import warnings
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from pma_gym.codegen.elementary import clip, maximum
from pma_gym.codegen.generic import square_root
from pma_gym.data.signals import SIGNALS
from pma_gym.documents import read_toml
from pma_gym.effects.cable.hanging_load import GRAVITY
from pma_gym.envs import StationInfo
from pma_gym.plant.model import Model, load_model, shipped_models
from pma_gym.tasks import Task
from pma_gym.units import SI_FACTORS

DESIGNS_FILE = Path(__file__).with_name("designs.toml")
"""The settings of the controllers here, with where they come from."""

DESIGN_SCHEMA = 2

KINDS = {"extension": "displacement", "rotation": "rotation", "contraction": "contraction"}
"""Kind of a task by the quantity that it asks for; an exercise's is its own."""

EXERCISE_KINDS = ("isokinetic", "moment")
"""Kinds of exercises: of a speed that is prescribed, and of a moment."""

OTHER_PLANT = 2.0
"""Ratio of accelerations by volt beyond which a plant counts as another one: half the factor by
which a usual gain margin of 12 dB lets a loop's gain grow (assumption)."""

Settings = TypeVar("Settings", bound=NamedTuple)


def designed(
    controller: str,
    station: StationInfo,
    defaults: Mapping[str, Settings],
    path: Path = DESIGNS_FILE,
) -> Settings:
    """Settings of a controller for a station's loop and task.

    The file is keyed controller -> loop -> kind of task -> values. A loop that was not designed
    for takes the settings of the one that is nearest in dead time.

    Args:
        controller: the controller's name.
        station: its period, delays and task.
        defaults: by kind of task (`task_kind`), for what the file does not give.
        path: file of settings.
    Returns:
        The defaults of the task's kind with the file's values in their place.
    Raises:
        ValueError: the task is an exercise, and the controller follows positions; or the file gives
            a value that the settings do not have, or has another schema.
    """
    kind = task_kind(station)
    if kind not in defaults:
        must_give_a_position(station)
    loops = kept_settings(path, DESIGN_SCHEMA, "design").get(controller, {})
    known = [name for name, kinds in loops.items() if kind in kinds]
    if not known:
        return defaults[kind]
    warn_of_other_plant(
        station,
        f"the settings of {controller}",
        station.model.plant,
        f"give {controller} settings of its own",
    )
    table = loops[nearest_loop(loop_name(station), known)][kind]
    values = {name: value for name, value in table.items() if name != "provenance"}
    strange = [name for name in values if name not in defaults[kind]._fields]
    if strange:
        raise ValueError(
            f"{path.name} gives {controller} the settings {', '.join(strange)}, it has "
            f"{', '.join(defaults[kind]._fields)}; write it anew: python -m benchmarks design"
        )
    return defaults[kind]._replace(**values)


def warn_of_other_plant(station: StationInfo, what: str, name: str, fix: str) -> None:
    """Warn where settings were made for a plant that moves otherwise: the loop may oscillate.

    Args:
        station: its model and task.
        what: the settings, for the message.
        name: name of the model that they were made for.
        fix: what to do, for the message.
    """
    ours = _acceleration(station.model, station.task)
    theirs = _acceleration(_shipped(name), station.task) if name in shipped_models() else None
    if ours and theirs and not 1.0 / OTHER_PLANT <= ours / theirs <= OTHER_PLANT:
        warnings.warn(
            f"{what} were made for model {name}; a volt of the {station.task.actuator} accelerates "
            f"model {station.model.name} {ours / theirs:.2g} times as much in task "
            f"{station.task.name}, so that the loop may oscillate or be slow; {fix}",
            stacklevel=3,
        )


_shipped = cache(load_model)


def _acceleration(model: Model, task: Task) -> float | None:
    """Signal of the task's actuator by volt and moving mass; None without a balance of forces."""
    if not model.rig.balances_loads:
        return None
    known = model.parameters
    rotor, hanging = known["rotor"], known.get("hanging_load")
    mass = known["slide"].mass + rotor.inertia / rotor.radius**2
    mass += hanging.share * task.load / GRAVITY if hanging else 0.0
    return known["drive" if task.actuator == "motor" else "regulator_line"].gain / mass


def task_kind(station: StationInfo) -> str:
    """Kind of a station's task, whatever its name: see `kind_of`."""
    return kind_of(station.task)


def kind_of(task: Task) -> str:
    """`displacement`, `rotation` or `contraction`; of an exercise `isokinetic` or `moment`."""
    if task.exercise is not None:
        return EXERCISE_KINDS[0 if task.exercise.prescription is None else 1]
    return KINDS[task.schedule.quantity]


def must_give_a_position(station: StationInfo) -> None:
    """Refuse a task that gives no position to follow.

    Raises:
        ValueError: the task is an exercise; says who can do it.
    """
    if station.task.exercise is not None:
        raise ValueError(
            "this controller follows a position: the task must give one in mm or deg, got "
            f"{station.task.name}, an exercise, in which a person moves and a speed or a moment is "
            "prescribed; take a controller of exercises, such as constant_pressure or exercise_mpc"
        )


def loop_name(station: StationInfo) -> str:
    """Name of a loop: its control rate, and all delay in it if there is any.

    >>> from pma_gym.plant.model import load_model
    >>> from pma_gym.tasks import TASKS
    >>> where = StationInfo(load_model("cascade"), TASKS["displacement"], 3e5, 0.02)
    >>> loop_name(where)
    '50hz'
    >>> from dataclasses import replace
    >>> loop_name(replace(where, action_delay=0.02))
    '50hz_delay20ms'
    """
    delay = 1e3 * (station.action_delay + station.observation_delay)
    return f"{1.0 / station.period:g}hz" + (f"_delay{delay:g}ms" if delay else "")


def nearest_loop(loop: str, known: list[str]) -> str:
    """The loop whose dead time, a period and the delay, is nearest as a ratio; the first of two."""
    return min(known, key=lambda name: abs(math.log(_dead_time(name) / _dead_time(loop))))


def _dead_time(loop: str) -> float:
    """Period and delay of a loop (s), read off its name."""
    match = re.fullmatch(r"([0-9.e+-]+)hz(?:_delay([0-9.e+-]+)ms)?", loop)
    if match is None:
        raise ValueError(
            f"a loop is called like 100hz or 50hz_delay20ms (control rate in Hz, delay in ms), "
            f"got {loop!r}; write the settings anew: python -m benchmarks design"
        )
    return 1.0 / float(match[1]) + 1e-3 * float(match[2] or 0.0)


def read_settings(path: Path, schema: int, command: str) -> dict[str, Any]:
    """Read a file of settings.

    Args:
        path: the file.
        schema: its version.
        command: of the benchmark, that writes such a file.
    Returns:
        Its tables: by model or controller, loop and kind of task.
    Raises:
        ValueError: the file has another version.
    """
    document = read_toml(path)
    got = document.pop("schema", None)
    if got != schema:
        raise ValueError(
            f"{path} must have schema {schema}, got {got!r}; write it anew: "
            f"python -m benchmarks {command}"
        )
    return document


kept_settings = cache(read_settings)
"""As `read_settings`, for a file that stays as it is while this process lasts."""


GAINS_FILE = Path(__file__).with_name("gains.toml")
"""The gains of the controllers here, with where they come from."""

GAINS_SCHEMA = 3

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

    def scaled(self, share: Any) -> "Gains":  # noqa: ANN401
        """The gains in force where the reference covers this share of its range.

        They grow with the square of the share, to `end_factor`: at low pressure the muscle
        stiffens towards its resting length (at 150 kPa a volt moves it 10 mm at the start of the
        displacement task and 2 mm at its end), so that gains of one value would be too high
        here or too low there.

        Over the first fifth of the range they rise from `start_factor`: as the cable goes slack
        at the end of phase III, every push that noise makes stays, for the drive cannot push
        back and nothing else does. k_p and k_d pass noise on from sample to sample.
        """
        clipped = clip(share, 0.0, 1.0)
        end = 1.0 + (self.end_factor - 1.0) * clipped * clipped
        start = 1.0 + (self.start_factor - 1.0) * maximum(1.0 - clipped / START_SHARE, 0.0)
        return self._replace(
            proportional=end * start * self.proportional,
            integral=end * square_root(start) * self.integral,
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
    models = kept_settings(path, GAINS_SCHEMA, "tune")
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
    warn_of_other_plant(
        station,
        f"the gains of {controller}",
        name,
        f"tune its own: {tune}, and give the controller {mine} of controllers.design.designs",
    )
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
