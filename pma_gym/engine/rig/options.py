"""Options of an environment of any rig, and its task."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pma_gym.data.signals import Signal
from pma_gym.engine.option_checks import check_number, is_real
from pma_gym.engine.options import Options, draw_task, parse_options
from pma_gym.integrator.equations import COMMANDS
from pma_gym.plant.commands import Command, Limits, commands
from pma_gym.plant.equilibrium.solver import equilibria_at
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant
from pma_gym.plant.statics import Condition
from pma_gym.tasks import KINDS, Disturbances, Ranges, Task, TrackingTask, as_tracking
from pma_gym.tasks import named_tracking as named
from pma_gym.tasks.tracking import FASTEST_SINE_HZ, SPANS

REACHED = 0.9
"""Share of the way to the furthest angle that is the range of a reference (assumption)."""

STATION_ONLY = ("pressure_kpa", "memory_at_start", "regulator_action", "disturbances") + (
    "operator",
    "safety",
)
"""Options of a station's environments alone."""


@dataclass(frozen=True)
class RigOptions(Options):
    """Keyword arguments of a rig's environments, besides those of `Options`.

    Attributes:
        limits: lowest and highest command (SI) by name, which actions of -1 and 1 stand for; those
            of the model if not given.
        rest: commands (SI) by name with which an episode begins at rest; 0, of a pressure the
            middle of its limits, if not given.
        bounds: lowest and highest value (SI) of signals by name, beyond which an episode ends.
        span: range of the reference (SI), which errors are in percent of; if 0 by the signal, and
            by what muscles reach with an arm.
        duration_s: duration of an episode (s).
        load: force or torque (N, N m) on what moves, positive as the position grows; or lowest and
            highest, drawn at every reset.
        push: force or torque (N, N m) of pulses of 0.2 to 0.8 s either way, every 2.5 s on average.
    """

    limits: Limits = field(default_factory=dict)
    rest: Mapping[str, float] = field(default_factory=dict)
    bounds: Limits = field(default_factory=dict)
    span: float = 0.0
    duration_s: float = 10.0
    load: float | Sequence[float] = 0.0
    push: float = 0.0

    @classmethod
    def names(cls) -> list[str]:
        """Names of the keyword arguments."""
        return [name for name in super().names() if name not in STATION_ONLY]

    @property
    def commands(self) -> list[Command]:
        """The rig's commands."""
        return commands(self.nominal, self.limits)

    @property
    def outputs(self) -> tuple[Signal, ...]:
        """What can be measured on the rig."""
        return self.nominal.rig.signals

    @property
    def signals(self) -> tuple[Signal, ...]:
        """What the model's sensors measure; all outputs, exactly, where it has no sensor."""
        sensors = self.nominal.parameters
        return tuple(s for s in self.outputs if s.sensor in sensors) or self.outputs

    @property
    def disturbing(self) -> Disturbances:
        """Sizes of the disturbances."""
        return Disturbances(hand_push_force=self.push)

    @property
    def loads(self) -> tuple[float, float]:
        """Lowest and highest load (N, N m)."""
        low, high = (self.load, self.load) if is_real(self.load) else self.load  # type: ignore[misc]
        return float(low), float(high)

    @property
    def is_pushed(self) -> bool:
        """Whether a force from outside acts."""
        return bool(self.push or any(self.loads))

    def resting(self) -> dict[str, float]:
        """Inputs of the equations with which episodes begin at rest, by place."""
        asked = dict(self.rest)
        rest = {}
        for command in self.commands:
            usual = 0.5 * sum(command.limits) if command.signal.is_pressure else 0.0
            rest[command.place] = command.at(asked.pop(command.signal.name, usual))
        if asked:
            known = ", ".join(command.signal.name for command in self.commands)
            raise ValueError(f"rest names {', '.join(asked)}, and the rig commands {known}")
        return rest

    def settled(self, plant: Plant) -> Condition:
        """The condition of a plant in which episodes begin."""
        rest = self.resting()
        motor, regulator = (rest.get(name, 0.0) for name in COMMANDS)
        return plant.settle(motor, regulator_voltage=regulator)


def parse_rig_options(
    given: Mapping[str, Any], caller: str = "the environment", others: Sequence[str] = ()
) -> RigOptions:
    """Check keyword arguments and return the options; see `parse_options`."""
    known: dict[str, Any] = {"model": "station", **given}
    ranges = known.get("randomisation")
    if isinstance(ranges, Mapping):
        known["randomisation"] = Ranges(ranges)
    if isinstance(known["model"], str):
        known["model"] = load_model(known["model"])
    options = parse_options(known, caller, others, RigOptions)
    check_number("duration_s", options.duration_s, 0.1, 1e4, "s")
    check_number("span", options.span, 0.0, 1e9, "the signal's SI unit")
    check_number("push", options.push, 0.0, 1e9, "N or N m")
    if not is_real(options.load) and len(options.load) != 2:  # type: ignore[arg-type]
        raise ValueError(f"load must be a number or two, lowest and highest, got {options.load!r}")
    model, rig = options.nominal, options.nominal.rig
    if rig.imposes_motion:
        raise ValueError(
            f"model {model.name} is of an {rig.name} rig, whose drive follows a record of "
            "positions: it has no command to act by; take a slide, a joint or a station"
        )
    if options.is_pushed and not rig.push_port:
        raise ValueError(f"load and push need a rig that a force can push, got a {rig.name}")
    known_signals = [signal.name for signal in options.outputs]
    for name in options.bounds:
        if name not in known_signals:
            raise ValueError(f"bounds name {name!r}, and the rig has {', '.join(known_signals)}")
    options.resting()
    return options


def starts(options: RigOptions) -> dict[str, float]:
    """Values of the rig's signals where episodes of the nominal model begin (SI)."""
    plant = Plant(options.nominal, options.tolerance)
    condition = options.settled(plant)
    truth = plant.observe(condition.state[None, :], condition.zero_contraction)
    return {name: float(values[0]) for name, values in truth.items()}


def named_task(name: str, options: RigOptions, start: Mapping[str, float]) -> TrackingTask | None:
    """The task of a name such as `angle_steps_3`, or None."""
    span = options.span
    if not span and name.startswith("angle_") and "joint_range" in options.nominal.parameters:
        reach = REACHED * (furthest_angle(options) - start["angle"])
        span = max(min(SPANS["angle"], reach), 0.0)
    return named(name, options.signals, start.__getitem__, span, options.duration_s)


def furthest_angle(options: RigOptions) -> float:
    """Greatest angle (rad) at which the commands hold an arm of the nominal model.

    Where no command moves it at rest, all of the joint's range counts.
    """
    plant, lines = Plant(options.nominal), {each.place: each for each in options.commands}
    ends = [
        np.linspace(lines[place].low, lines[place].high, 21) if place in lines else np.zeros(1)
        for place in COMMANDS
    ]
    motor, regulator = (each.ravel() for each in np.meshgrid(*ends))
    angles = equilibria_at(plant, motor, regulator)[1]
    held = np.unique(angles[np.isfinite(angles)])
    return float(held[-1]) if len(held) > 1 else plant.parameters["joint_range"].highest


def parse_rig_task(given: str | Task | None, options: RigOptions) -> TrackingTask:
    """Return the task of a name, or a given Task as one in SI.

    Raises:
        ValueError: an unknown name, or a signal that the rig does not measure.
    """
    known = [signal.name for signal in options.signals]
    start = starts(options)
    task = named_task(given or f"{known[0]}_steps", options, start) if not isinstance(
        given, Task
    ) else as_tracking(given)  # fmt: skip
    if task is None or task.schedule.quantity not in known:
        raise ValueError(
            f"task must be a signal of the rig ({', '.join(known)}) with {', '.join(KINDS)}, such "
            f"as {known[0]}_steps, {known[0]}_steps_3 or {known[0]}_sine_2hz (0 to "
            f"{FASTEST_SINE_HZ:g} Hz), or a Task of pma_gym.tasks.tracking for one of these "
            f"signals, got {given!r}"
        )
    if options.reference is not None:
        several = options.reference if isinstance(options.reference, list) else []
        for one in (options.reference, *several):
            draw_rig_task(task, one, np.random.default_rng(0), options, start)
    return task


def draw_rig_task(
    task: Task,
    reference: object,
    generator: np.random.Generator,
    options: RigOptions,
    start: Mapping[str, float],
) -> Task:
    """Draw the task of an episode; see `draw_task`."""

    def known(name: str) -> TrackingTask:
        drawn = named_task(name, options, start)
        if drawn is None:
            raise ValueError(
                f"reference: {name!r} is no task of this rig, such as "
                f'{options.signals[0].name}_steps_3; "random" draws another seed of such a task'
            )
        return drawn

    return draw_task(task, reference, generator, known)
