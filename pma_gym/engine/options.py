"""The environments' options: checked once, with errors that say how to mend them."""

import copy
import difflib
import numbers
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Self, TypedDict, TypeGuard

import numpy as np

from pma_gym.data.trial_checks import check_memory_at_start
from pma_gym.effects import CATALOGUE
from pma_gym.engine.plain_values import plain_options, plain_sequence
from pma_gym.engine.renamed_options import renamed_options
from pma_gym.engine.reward_function import RewardFunction, check_reward_function
from pma_gym.pickling import Packed, packed
from pma_gym.plant.compiled_model import DEFAULT_TOLERANCE, check_tolerance
from pma_gym.plant.memory_start import begun_at
from pma_gym.plant.model import Model, load_model
from pma_gym.tasks import (
    DISTURBANCES,
    EVERY_TASK,
    LOWEST_RATE_HZ,
    OPERATOR_BOUNDS,
    RANDOMISATIONS,
    REWARDS,
    Disturbances,
    Operator,
    Randomisation,
    Task,
    named_task,
)

LOWEST_PRESSURE_KPA = 150.0
HIGHEST_PRESSURE_KPA = 575.0
"""Pressures at which the station was ever shown (kPa): table I3."""


class DefaultSteps(int):
    """A number of steps that follows from the options, not one that a user asked for."""

    # Gymnasium 1.1 takes it as a bound of a Box only if NumPy knows it as an integer.
    dtype = np.dtype(np.int64)


OPERATORS = ("random", "typical")
"""Operators by name."""

Pressure = float | Sequence[float] | str
"""Gauge pressure of the episodes (kPa): one, several to draw from, or "random"."""


@dataclass(frozen=True)
class Options:
    """Keyword arguments of the environments; each survives JSON (a model as a name or path).

    Numbers of NumPy, arrays, ranges and paths are kept as plain Python values.

    Attributes:
        pressure_kpa: gauge pressure of the episodes (kPa): a number, several to draw from (a list,
            a range, an array), or "random" for any that the task's trials begin at.
        model: name of a shipped model, path of a TOML file, or a Model.
        memory_at_start: where the muscle's hysteresis stands as an episode begins, -1 to 1 (1: it
            was filled and has contracted); None: as the model says, or where a randomisation draws
            it, as drawn. A model without hysteresis has nothing to begin with.
        control_rate_hz: control steps a second (Hz).
        preview: how many future references the observation holds, one a control step.
        noise: sensor noise and quantisation; the sensors' lag stays either way.
        action_delay_s: time from an action to the drive (s), whole control steps.
        observation_delay_s: age of the sensors' values when the agent receives them (s), whole
            control steps.
        history: how many earlier readings of the position the observation holds.
        reward: name of a reward in `pma_gym.tasks.REWARDS`; or a function of four numbers, which
            is called after every step: the true error in percent of the range, the largest change
            of an action, the true position and its reference in the units of the info (mm, deg
            or N m). It does not survive JSON.
        reward_scale: positive number that every reward is multiplied by.
        randomisation: name of a randomisation in `pma_gym.tasks.RANDOMISATIONS`; or, for stations
            of one's own, a function of the nominal model and a generator that gives a model with
            the same effects (it does not survive JSON).
        regulator_action: whether a second action commands the regulator (0-10 V).
        disturbances: name of disturbances in `pma_gym.tasks.DISTURBANCES`.
        operator: who works in an exercise: "random" (drawn at every reset), "typical", or a
            `pma_gym.tasks.Operator` (which does not survive JSON).
        safety: whether an exercise has its safety layer between agent and regulator.
        tolerance: largest error of an internal step of the integrator, as a share of what the
            plant's states are counted against (`Plant`); a larger one is faster, a smaller one
            more exact.
        max_episode_steps: control steps after which an episode is truncated, if its task lasts
            longer; None: as long as the task.
    """

    pressure_kpa: Pressure = "random"
    model: str | Path | Model = "station"
    memory_at_start: float | None = None
    control_rate_hz: float = 100.0
    preview: int = 0
    noise: bool = True
    action_delay_s: float = 0.0
    observation_delay_s: float = 0.0
    history: int = 0
    reward: str | RewardFunction = "absolute"
    reward_scale: float = 1.0
    randomisation: str | Randomisation = "none"
    regulator_action: bool = False
    disturbances: str = "none"
    operator: str | Operator = "random"
    safety: bool = True
    tolerance: float = DEFAULT_TOLERANCE
    max_episode_steps: int | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Its fields for pickle; functions among them need no module."""
        return {n: packed(n, v) if callable(v) else v for n, v in vars(self).items()}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        """Take what `__getstate__` gave."""
        given = {n: v.value() if isinstance(v, Packed) else v for n, v in state.items()}
        self.__dict__.update(given)

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """A copy that keeps functions, and copies objects that act as one."""
        return replace(self, **{n: copy.deepcopy(v, memo) for n, v in vars(self).items()})

    @property
    def disturbing(self) -> Disturbances:
        """Sizes of what disturbs."""
        return DISTURBANCES[self.disturbances]

    @property
    def draw(self) -> Randomisation:
        """What gives the station of an episode."""
        chosen = self.randomisation
        return RANDOMISATIONS[chosen] if isinstance(chosen, str) else chosen

    @property
    def period(self) -> float:
        """Time of a control step (s)."""
        return 1.0 / self.control_rate_hz

    @property
    def action_delay(self) -> int:
        """Time from an action to the drive, in control steps."""
        return round(self.action_delay_s * self.control_rate_hz)

    @property
    def observation_delay(self) -> int:
        """Age of the sensors' values when the agent receives them, in control steps."""
        return round(self.observation_delay_s * self.control_rate_hz)

    @property
    def reward_name(self) -> str:
        """Name of the reward; "function" for a user's, whatever it is."""
        return self.reward if isinstance(self.reward, str) else "function"

    @property
    def nominal(self) -> Model:
        """The model as it is read, with memories where episodes shall begin.

        Raises:
            ModelError: no such model, or one that cannot be used.
        """
        return begun_at(load_model(self.model), self.memory_at_start)

    def horizon(self, task: Task) -> int:
        """Control steps after which an episode of a task is truncated."""
        whole = task.steps(self.control_rate_hz)
        return whole if self.max_episode_steps is None else min(whole, self.max_episode_steps)


class EnvironmentOptions(TypedDict, total=False):
    """Types of the keyword arguments of environments, for editors; see `Options` for each."""

    pressure_kpa: Pressure
    model: str | Path | Model
    memory_at_start: float | None
    control_rate_hz: float
    preview: int
    noise: bool
    action_delay_s: float
    observation_delay_s: float
    history: int
    reward: str | RewardFunction
    reward_scale: float
    randomisation: str | Randomisation
    regulator_action: bool
    disturbances: str
    operator: str | Operator
    safety: bool
    tolerance: float
    max_episode_steps: int | None


def parse_options(
    given: Mapping[str, Any], caller: str = "the environment", others: Sequence[str] = ()
) -> Options:
    """Checked options from keyword arguments.

    Args:
        given: the keyword arguments.
        caller: who takes them, for the message.
        others: names of further keyword arguments that the caller takes, for the message.

    Raises:
        TypeError: an unknown keyword, with the nearest known one.
        ValueError: a value that is out of range or of the wrong kind.
    """
    given = renamed_options(given, caller, stacklevel=3)
    check_keywords(caller, given, [field.name for field in fields(Options)], others)
    if isinstance(given.get("max_episode_steps"), DefaultSteps):
        # Of the registered options, not of these: nobody asked for it.
        given = {**given, "max_episode_steps": None}
    options = Options(**plain_options(given))
    _check_model(options.model)
    check_memory_at_start(options.memory_at_start, "episodes")
    _check_rate_and_delays(options)
    for name in ("preview", "history"):
        _check_whole(name, getattr(options, name))
    for name in ("noise", "regulator_action", "safety"):
        if not isinstance(getattr(options, name), bool):
            raise ValueError(f"{name} must be true or false, got {getattr(options, name)!r}")
    if callable(options.reward):
        check_reward_function(options.reward)
    else:
        check_named("reward", options.reward, REWARDS)
    if not _is_real(options.reward_scale) or not 0.0 < options.reward_scale <= 1e9:
        raise ValueError(
            f"reward_scale must be a number above 0 and up to 1e9, got {options.reward_scale!r}"
        )
    if options.max_episode_steps is not None:
        _check_max_episode_steps(options.max_episode_steps)
    if not callable(options.randomisation):
        check_named("randomisation", options.randomisation, RANDOMISATIONS)
    check_named("disturbances", options.disturbances, DISTURBANCES)
    if isinstance(options.operator, Operator):
        check_operator(options.operator)
    elif options.operator not in OPERATORS:
        raise ValueError(
            f"operator must be one of {', '.join(OPERATORS)} or a pma_gym.tasks.Operator, got "
            f"{options.operator!r}"
        )
    check_pressure(options.pressure_kpa)
    check_tolerance(options.tolerance)
    return options


def parse_task(given: str | Task, options: Options) -> Task:
    """The task of a name, or a task as it is, if the options suit it.

    Raises:
        ValueError: an unknown name, with the nearest known one; or an option that the task has no
            use for.
    """
    task = named_task(given) if isinstance(given, str) else given
    if not isinstance(task, Task):
        raise _unknown("task", given, list(EVERY_TASK))
    if task.actuator == "regulator" and options.regulator_action:
        raise ValueError(
            f"regulator_action gives the motor's tasks a second action; the only action of task "
            f"{task.name} is the regulator's already: leave the option out"
        )
    _check_exercise(task, options)
    return task


def _check_exercise(task: Task, options: Options) -> None:
    """Refuse what an exercise cannot have, and what nothing else has a use for."""
    if task.exercise is None:
        for name, usual in (("operator", "random"), ("safety", True)):
            if getattr(options, name) != usual:
                raise ValueError(
                    f"{name} is an option of exercises, and task {task.name} is none; "
                    "leave it out, or take isokinetic_exercise, isotonic_exercise or "
                    "profile_exercise"
                )
        return
    if options.control_rate_hz < LOWEST_RATE_HZ:
        raise ValueError(
            f"control_rate_hz must be at least {LOWEST_RATE_HZ:g} Hz in task {task.name}, where "
            "the motor plays the operator once a control step, got "
            f"{options.control_rate_hz:g} Hz"
        )
    if options.preview and task.exercise.prescription:
        raise ValueError(
            f"preview shows a reference that goes by time; the moment of task {task.name} goes by "
            f"the angle: leave the option out, got {options.preview!r}"
        )


def rig_model(task: Task, options: Options) -> Model:
    """The nominal model with all that the options ask for: somebody at the slide, if they do.

    Raises:
        ModelError: no such model, or one that cannot be used.
        ValueError: a cascade where there must be a station.
    """
    model = options.nominal
    if not model.rig.has_muscle:
        raise ValueError(
            f"an environment needs the model of a station or a cascade, got {model.name}, a slide, "
            "which has no muscle; take station or serres2008"
        )
    pushed = options.disturbing.hand_push_force != 0.0
    if not model.rig.balances_loads and (pushed or task.load or task.exercise):
        what = f"disturbances={options.disturbances!r}" if pushed else f"task {task.name}"
        held = "plays an operator" if task.exercise else "holds a load"
        why = "somebody pulls at its slide" if pushed else f"the motor {held}"
        raise ValueError(
            f"{what} needs the model of a station, where {why}; got {model.name}, a {model.plant}; "
            "take station or serres2008"
        )
    model = nominal_model(task, model)
    if not pushed or "hand_push" in model.parameters:
        return model
    return model.with_effects({"hand_push": {"share": 1.0}})


def nominal_model(task: Task, model: Model) -> Model:
    """The nominal model that controllers receive: with a leg on its lever in an exercise."""
    if task.exercise is None or "leg" in model.parameters or not model.rig.balances_loads:
        return model
    leg = CATALOGUE["leg"]
    usual = {door: leg.quantities[stem].usual for door, stem in leg.names_at_the_door().items()}
    return model.with_effects({"leg": {door: float(value or 0.0) for door, value in usual.items()}})


def motor_at_rest(model: Model, task: Task) -> float:
    """Motor voltage that episodes begin at (V): what a nominal drive needs for the task's load.

    Raises:
        ValueError: the drive does not hold such a load.
    """
    load = rest_load(model, task)
    if not load:
        return 0.0
    drive = model.parameters["drive"]
    volts = (load - drive.offset) / drive.gain
    if not 0.0 <= volts <= 10.0:
        raise ValueError(
            f"task {task.name}: the load must lie in {max(0.0, drive.offset):.4g} to "
            f"{10.0 * drive.gain + drive.offset:.4g} N, what the drive of model {model.name} holds "
            f"with 0-10 V; got {load:g} N"
        )
    return volts


def rest_load(model: Model, task: Task) -> float:
    """Load that the motor holds as an episode begins (N), by the nominal pulley."""
    if task.exercise is None:
        return task.load
    return task.exercise.start_moment / model.parameters["rotor"].radius


def check_known(what: str, given: Iterable[str], known: Sequence[str]) -> None:
    """Refuse names that nobody knows.

    Raises:
        TypeError: the first unknown name, the nearest known one, and all known.
    """
    for name in given:
        if name not in known:
            raise TypeError(
                f"unknown {what} {name!r}{_nearest(name, known)}; known: {', '.join(known)}"
            )


def check_keywords(
    caller: str, given: Iterable[str], known: Sequence[str], others: Sequence[str] = ()
) -> None:
    """Refuse keyword arguments that do not exist, in Python's own words.

    Libraries look for these words to see whether an environment takes an argument.

    Args:
        caller: who takes them.
        given: names that came.
        known: names of the options.
        others: names of further keyword arguments of the caller.
    Raises:
        TypeError: the first unknown name, the nearest known one, and all known.
    """
    for name in given:
        if name not in known:
            raise TypeError(
                f"{caller} got an unexpected keyword argument {name!r}"
                f"{_nearest(name, [*known, *others])}; known: {', '.join([*known, *others])}"
            )


def check_named(what: str, value: object, known: Iterable[str]) -> None:
    """Refuse a value that is none of the known names.

    Raises:
        ValueError: what it is, the known names, what came and the nearest known name.
    """
    names = list(known)
    if not isinstance(value, str) or value not in names:
        raise _unknown(what, value, names)


def check_operator(operator: Operator) -> None:
    """Refuse an operator whom nobody could be.

    Raises:
        ValueError: names the number, its range and unit, and what came.
    """
    for name, value in operator._asdict().items():
        lower, upper, unit = OPERATOR_BOUNDS[name]
        _check_number(f"operator.{name}", value, lower, upper, unit)


def check_pressure(pressure: object) -> None:
    """Refuse a pressure that the station was never shown at.

    Raises:
        ValueError: names the range, the unit and what came.
    """
    if isinstance(pressure, str) and pressure == "random":
        return
    several = pressure if isinstance(pressure, list | tuple) else [pressure]
    if not several or not all(map(_is_real, several)):
        raise ValueError(
            f'pressure_kpa must be a number in kPa, a list of numbers or "random", got {pressure!r}'
        )
    for one in several:
        _check_number("pressure_kpa", one, LOWEST_PRESSURE_KPA, HIGHEST_PRESSURE_KPA, "kPa")


def parse_pressure(given: object) -> Pressure:
    """The checked pressure of episodes, as plain Python values.

    Raises:
        ValueError: names the range, the unit and what came.
    """
    pressure = plain_sequence(given)
    check_pressure(pressure)
    return pressure


def parse_pressures(given: object, count: int) -> list[Pressure]:
    """The checked pressures of so many environments, one each, as plain Python values.

    Raises:
        ValueError: names the rule and what came.
    """
    pressures = plain_sequence(given)
    length = f"{len(pressures)}" if isinstance(pressures, list) else "no sequence"
    if length != f"{count}":
        raise ValueError(
            f"pressures_kpa must hold one pressure for each of the {count} environments, got "
            f"{length}: {given!r}; pressure_kpa is one for all"
        )
    for pressure in pressures:
        check_pressure(pressure)
    return pressures


def check_count(name: str, count: object, most: int) -> None:
    """Refuse a number of things that is none.

    Raises:
        ValueError: names it, the rule and what came.
    """
    if not _is_whole(count) or not 1 <= count <= most:
        raise ValueError(f"{name} must be a whole number in 1-{most}, got {count!r}")


def _check_model(model: object) -> None:
    if not isinstance(model, str | Path | Model):
        raise ValueError(
            f"model must be a shipped model's name, the path of a .toml file or a Model, "
            f"got {model!r}"
        )


def _check_rate_and_delays(options: Options) -> None:
    _check_number("control_rate_hz", options.control_rate_hz, 1.0, 10000.0, "Hz")
    for name in ("action_delay_s", "observation_delay_s"):
        delay = getattr(options, name)
        _check_number(name, delay, 0.0, 1.0, "s")
        steps = delay * options.control_rate_hz
        if abs(steps - round(steps)) > 1e-6:
            raise ValueError(
                f"{name} must be a whole number of control steps of {options.period:g} s, "
                f"got {delay:g} s = {steps:g} steps; change it or control_rate_hz"
            )


def _check_max_episode_steps(steps: object) -> None:
    if not _is_whole(steps) or steps < 1:
        raise ValueError(
            f"max_episode_steps must be a whole number of control steps from 1 on, got {steps!r}; "
            "leave it out for the whole task"
        )


def _check_whole(name: str, value: object) -> None:
    if not _is_whole(value) or not 0 <= value <= 1000:
        raise ValueError(f"{name} must be a whole number of control steps in 0-1000, got {value!r}")


def _check_number(name: str, value: object, lower: float, upper: float, unit: str) -> None:
    # `not <=`: NaN is out of every range.
    if not _is_real(value) or not lower <= value <= upper:
        raise ValueError(f"{name} must be a number in {lower:g}-{upper:g} {unit}, got {value!r}")


def _is_real(value: object) -> TypeGuard[float]:
    return isinstance(value, numbers.Real) and not isinstance(value, bool)


def _is_whole(value: object) -> TypeGuard[int]:
    return isinstance(value, numbers.Integral) and not isinstance(value, bool)


def _unknown(what: str, value: object, names: Sequence[str]) -> ValueError:
    return ValueError(
        f"{what} must be one of {', '.join(names)}, got {value!r}{_nearest(value, names)}"
    )


def _nearest(name: object, known: Sequence[str]) -> str:
    close = difflib.get_close_matches(str(name).lower(), known, n=1, cutoff=0.5)
    return f" (did you mean {close[0]!r}?)" if close else ""
