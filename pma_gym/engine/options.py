"""The environments' options and their checks; errors contain the fix."""

import copy
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Self, TypedDict, TypeVar

import numpy as np

from pma_gym.data.trial_checks import check_memory_at_start
from pma_gym.engine.option_checks import (
    Pressure,
    RewardFunction,
    check_keywords,
    check_named,
    check_number,
    check_operator,
    check_pressure,
    check_reward_function,
    check_whole,
    is_real,
    is_whole,
    plain_options,
    unknown_name,
)
from pma_gym.pickling import Packed, packed
from pma_gym.plant.compiled_model import DEFAULT_TOLERANCE, check_tolerance
from pma_gym.plant.memory_start import begun_at
from pma_gym.plant.model import Model, load_model
from pma_gym.tasks import (
    DISTURBANCES,
    EVERY_TASK,
    LOWEST_RATE_HZ,
    RANDOMISATIONS,
    REWARDS,
    Disturbances,
    Operator,
    Randomisation,
    Task,
    TrackingTask,
    named_task,
)
from pma_gym.tasks.unseen import SEEDS, unseen


class DefaultSteps(int):
    """Number of steps that follows from the options and was not set by a user."""

    # Gymnasium 1.1 takes it as a bound of a Box only if NumPy knows it as an integer.
    dtype = np.dtype(np.int64)


Reference = str | Task | Sequence[str | Task]
"""What episodes follow: "random", a task's name, a Task, or several to draw from."""

OPERATORS = ("random", "typical")
"""Operators by name."""


@dataclass(frozen=True)
class Options:
    """Keyword arguments of the environments; each survives JSON (a model as a name or path).

    NumPy numbers, arrays, ranges and paths become plain Python values.

    Attributes:
        pressure_kpa: gauge pressure of the episodes (kPa): a number, several to draw from (a list,
            a range, an array) within the validity of the model, or "random" for all initial
            pressures of the task's trials that lie there.
        model: name of a shipped model, path of a TOML file, or a Model.
        memory_at_start: initial hysteresis state of the muscle, -1 to 1 (1: filled and contracted);
            None: the value of the model or of the randomisation. It has no effect on a model
                without
            hysteresis.
        control_rate_hz: control rate (Hz).
        preview: number of future references in the observation, one per control step.
        noise: add sensor noise and quantisation; the sensors' lag applies always.
        action_delay_s: delay from an action to the drive (s), whole control steps.
        observation_delay_s: age of the measurements when the agent receives them (s), whole control
            steps.
        history: number of earlier measured positions in the observation.
        reward: name of a reward in `pma_gym.tasks.REWARDS`; or a function of four numbers, which
            is called after every step: the true error in percent of the range, the largest change
            of an action, the true position and its reference in the units of the info (mm, deg
            or N m). A function cannot be written to JSON.
        reward_scale: positive factor on every reward.
        randomisation: name of a randomisation in `pma_gym.tasks.RANDOMISATIONS`; or a function of
            the nominal model and a generator that returns a model with the same effects (a
            function cannot be written to JSON).
        reference: what episodes follow instead of the task's reference, drawn at every reset:
            "random" (another seed of a multisine, of steps or of speeds), a name of a task or a
            Task, several of these (a list), or a function of a generator that returns one (which
            cannot be written to JSON). All differ from the task in their reference alone; None for
            the task's.
        regulator_action: whether a second action commands the regulator (0-10 V).
        disturbances: name of disturbances in `pma_gym.tasks.DISTURBANCES`.
        operator: operator of an exercise: "random" (drawn at every reset), "typical", or a
            `pma_gym.tasks.Operator` (which cannot be written to JSON).
        safety: whether an exercise has its safety filter between agent and regulator.
        tolerance: largest error of an internal step of the integrator, relative to the scales of
            the plant's states (`Plant`); a larger one is faster, a smaller one more accurate.
        max_episode_steps: control steps after which an episode is truncated, if its task lasts
            longer; None for the length of the task.
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
    reference: Reference | Callable[[np.random.Generator], Reference] | None = None
    regulator_action: bool = False
    disturbances: str = "none"
    operator: str | Operator = "random"
    safety: bool = True
    tolerance: float = DEFAULT_TOLERANCE
    max_episode_steps: int | None = None

    @classmethod
    def names(cls) -> list[str]:
        """Names of the keyword arguments."""
        return [field.name for field in fields(cls)]

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields for pickle; functions among them need no module."""
        return {n: packed(n, v) if callable(v) else v for n, v in vars(self).items()}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        """Restore the fields from `__getstate__`."""
        given = {n: v.value() if isinstance(v, Packed) else v for n, v in state.items()}
        self.__dict__.update(given)

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """Return a copy that shares functions and copies callable objects."""
        return replace(self, **{n: copy.deepcopy(v, memo) for n, v in vars(self).items()})

    @property
    def disturbing(self) -> Disturbances:
        """Sizes of the disturbances."""
        return DISTURBANCES[self.disturbances]

    @property
    def draw(self) -> Randomisation:
        """Function that draws the station of an episode."""
        chosen = self.randomisation
        return RANDOMISATIONS[chosen] if isinstance(chosen, str) else chosen

    @property
    def period(self) -> float:
        """Duration of a control step (s)."""
        return 1.0 / self.control_rate_hz

    @property
    def action_delay(self) -> int:
        """Delay from an action to the drive, in control steps."""
        return round(self.action_delay_s * self.control_rate_hz)

    @property
    def observation_delay(self) -> int:
        """Age of the measurements when the agent receives them, in control steps."""
        return round(self.observation_delay_s * self.control_rate_hz)

    @property
    def reward_name(self) -> str:
        """Name of the reward; "function" for a user's function."""
        return self.reward if isinstance(self.reward, str) else "function"

    @property
    def nominal(self) -> Model:
        """The loaded model, with the initial hysteresis state of the options.

        Raises:
            ModelError: an unknown or invalid model.
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
    reference: Reference | Callable[[np.random.Generator], Reference] | None
    regulator_action: bool
    disturbances: str
    operator: str | Operator
    safety: bool
    tolerance: float
    max_episode_steps: int | None


Kind = TypeVar("Kind", bound=Options)


def parse_options(
    given: Mapping[str, Any],
    caller: str = "the environment",
    others: Sequence[str] = (),
    kind: type[Kind] = Options,  # type: ignore[assignment]
) -> Kind:
    """Check keyword arguments and return the options.

    Args:
        given: the keyword arguments.
        caller: name of the called function or class, for the message.
        others: names of the caller's further keyword arguments, for the message.
        kind: of the options.

    Raises:
        TypeError: an unknown keyword, with the nearest known one.
        ValueError: a value that is out of range or of the wrong kind.
    """
    check_keywords(caller, given, kind.names(), others)
    if isinstance(given.get("max_episode_steps"), DefaultSteps):
        # Of the registered options, not of these: nobody asked for it.
        given = {**given, "max_episode_steps": None}
    options = kind(**plain_options(given))
    _check_model(options.model)
    check_memory_at_start(options.memory_at_start, "episodes")
    _check_rate_and_delays(options)
    for name in ("preview", "history"):
        check_whole(name, getattr(options, name))
    for name in ("noise", "regulator_action", "safety"):
        if not isinstance(getattr(options, name), bool):
            raise ValueError(f"{name} must be true or false, got {getattr(options, name)!r}")
    if callable(options.reward):
        check_reward_function(options.reward)
    else:
        check_named("reward", options.reward, REWARDS)
    if not is_real(options.reward_scale) or not 0.0 < options.reward_scale <= 1e9:
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
    """Return the task of a name, or a given Task, after a check of the options.

    Raises:
        ModelError: an unknown or invalid model.
        ValueError: an unknown name, with the nearest known one; an option that does not apply to
            the task; or a start pressure outside the model's validity.
    """
    task = _known_task("task", given)
    if isinstance(task, TrackingTask):
        raise ValueError(
            f"task {task.name} is a reference for a signal of any rig: make it with "
            'gym.make("pma_gym/Rig-v0", model=..., task=...), or take pma_gym.tasks.following'
        )
    if options.reference is not None:
        several = options.reference if isinstance(options.reference, list) else []
        for one in (options.reference, *several):
            draw_task(task, one, np.random.default_rng(0))
    if task.actuator == "regulator" and options.regulator_action:
        raise ValueError(
            f"regulator_action gives the motor's tasks a second action; the only action of task "
            f"{task.name} is the regulator's already: leave the option out"
        )
    _check_exercise(task, options)
    model = options.nominal
    return _started_within(task, options.pressure_kpa, model) if model.rig.has_muscle else task


def _known_task(what: str, given: object, *others: str) -> Task:
    task = named_task(given) if isinstance(given, str) else given
    if not isinstance(task, Task):
        raise unknown_name(what, given, [*others, *EVERY_TASK])
    return task


def draw_task(
    task: Task,
    reference: object,
    generator: np.random.Generator,
    named: Callable[[str], Task | None] | None = None,
) -> Task:
    """Draw the task of an episode.

    Args:
        task: the environment's task.
        reference: the option `reference`.
        generator: random numbers of the episode.
        named: the task of a name, where it is none of a station.
    Raises:
        ValueError: no task, or one that differs from the environment's in more than its reference.
    """
    drawn = reference(generator) if callable(reference) else reference
    if isinstance(drawn, list) and drawn:
        drawn = drawn[generator.integers(len(drawn))]
    if isinstance(drawn, str) and drawn == "random":
        kind = re.sub("_[0-9]+$", "", task.name)
        drawn = (named or unseen)(f"{kind}_{generator.integers(SEEDS)}")
        if drawn is None:
            raise ValueError(
                'reference "random" draws another seed of a task such as displacement_multisine, '
                f"rotation_steps or rotation_speeds, and task {task.name} has none: make the "
                "environment with one of these, or give tasks to draw from"
            )
    if not isinstance(drawn, str | Task):
        raise ValueError(
            'reference must be "random", a task\'s name, a Task (pma_gym.tasks.following makes one '
            "of a function of time), a list of these, or a function of a generator that returns "
            f"one, got {drawn!r}"
        )
    drawn = (isinstance(drawn, str) and named and named(drawn)) or drawn
    drawn = _known_task("reference", drawn, "random")
    own, other = ((t.structure, t.load, t.exercise) for t in (task, drawn))
    if own != other:
        raise ValueError(
            f"reference {drawn.name} differs from task {task.name} in more than its reference "
            "(quantity, actuator, range, pressures, load, phases or exercise): make the "
            f"environment with task {drawn.name}, and draw from tasks of its kind"
        )
    return drawn


def _started_within(task: Task, pressure: Pressure, model: Model) -> Task:
    """Check the pressure of episodes, and limit the task's start pressures to the validity."""
    check_pressure(pressure, model)
    valid = model.parameters["validity"]
    low, high = task.starts
    if pressure == "random" and not (low <= valid.highest and high >= valid.lowest):
        raise ValueError(
            f"task {task.name} begins at {1e-3 * low:g}-{1e-3 * high:g} kPa, and model "
            f"{model.name} is valid at {1e-3 * valid.lowest:g}-{1e-3 * valid.highest:g} kPa; give "
            "pressure_kpa, or a task with other start_pressures (Pa)"
        )
    starts = tuple(min(max(each, valid.lowest), valid.highest) for each in task.starts)
    return task if starts == task.starts else replace(task, start_pressures=starts)


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


def _check_model(model: object) -> None:
    if not isinstance(model, str | Path | Model):
        raise ValueError(
            f"model must be a shipped model's name, the path of a .toml file or a Model, "
            f"got {model!r}"
        )


def _check_rate_and_delays(options: Options) -> None:
    check_number("control_rate_hz", options.control_rate_hz, 1.0, 10000.0, "Hz")
    for name in ("action_delay_s", "observation_delay_s"):
        delay = getattr(options, name)
        check_number(name, delay, 0.0, 1.0, "s")
        steps = delay * options.control_rate_hz
        if abs(steps - round(steps)) > 1e-6:
            raise ValueError(
                f"{name} must be a whole number of control steps of {options.period:g} s, "
                f"got {delay:g} s = {steps:g} steps; change it or control_rate_hz"
            )


def _check_max_episode_steps(steps: object) -> None:
    if not is_whole(steps) or steps < 1:
        raise ValueError(
            f"max_episode_steps must be a whole number of control steps from 1 on, got {steps!r}; "
            "leave it out for the whole task"
        )
