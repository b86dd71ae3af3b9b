"""Numbers and observation of an environment of any rig."""

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from gymnasium import spaces

from pma_gym.data.signals import Signal
from pma_gym.engine.observation import BOUND, ObservationTable, Prescribed
from pma_gym.engine.rig.options import RigOptions
from pma_gym.engine.state_layout import StateLayout
from pma_gym.tasks import Task
from pma_gym.tasks.tracking import SPANS
from pma_gym.units import suffix


def key(signal: Signal, before: str = "") -> str:
    """Key of a signal in an info, which ends in its SI unit: `angle_rad`."""
    return f"{before}{signal.name}_{suffix(signal.si_unit)}"


class RigLayout(StateLayout):
    """Offsets of an environment's numbers, for the signals and commands of its rig."""

    options: RigOptions

    @cached_property
    def commands(self) -> list[Any]:
        """The rig's commands."""
        return self.options.commands

    @cached_property
    def signals(self) -> tuple[Signal, ...]:  # type: ignore[override]
        """The measured signals."""
        return self.options.signals

    @property
    def parts(self) -> tuple[str, ...]:
        """Components of a measurement, in order."""
        return tuple(f"read_{signal.name}" for signal in self.signals)

    @property
    def push(self) -> str:
        """Name of the force that disturbances push with."""
        return "push"

    @property
    def recorded(self) -> str:
        """Command that a single environment writes down in every step."""
        return self.commands[0].place

    @property
    def actions(self) -> int:
        """Entries of an action."""
        return len(self.commands)

    @property
    def info(self) -> list[str]:
        """Keys of a step's info that are numbers, in order."""
        unit = self.task.schedule.suffix
        return [
            "time_s",
            *(key(signal) for signal in self.options.outputs),
            *(key(signal, "measured_") for signal in self.signals),
            f"reference_{unit}",
            f"error_{unit}",
            *(key(command.signal) for command in self.commands),
            "push_force",
        ]

    @property
    def held(self) -> list[str]:
        """Inputs of the integration that are constant during a control step."""
        pushed = [self.push] if self.options.is_pushed else []
        return ["motor_voltage", "regulator_voltage", "zero_contraction", *pushed]

    @cached_property
    def offsets(self) -> dict[str, int]:
        """Offset of every number by name."""
        delay = self.options.action_delay
        names = [
            *self.states,
            *("size", "zero_contraction", "motor_voltage", "regulator_voltage"),
            *(self.push, "load_at_rest"),
            *self.events,
            *("rest_regulator", "count", "sample", "key_0", "key_1", "episode"),
            *(f"sum_{phase.name}" for phase in self.task.schedule.phases),
            *(f"action_{i}" for i in range(self.actions)),
            *(f"wire_{k}_{i}" for k in range(delay) for i in range(self.actions)),
            *(f"{part}_{k}" for k in range(self.readings) for part in self.parts),
            *(f"true_{signal.name}" for signal in self.options.outputs),
            "ended",
            *self.info,
            "reward",
        ]
        return {name: i for i, name in enumerate(names)}


class RigObservation(ObservationTable):
    """Entries of the observation: the rig's sensors, the reference, the last actions."""

    def __init__(self, task: Task, options: RigOptions) -> None:
        """List the entries."""
        schedule = task.schedule
        self._names = [signal.name for signal in options.signals]
        self._scales = [
            schedule.span if signal.name == schedule.quantity else SPANS[signal.measures]
            for signal in options.signals
        ]
        self._span, self._quantity = schedule.span, schedule.quantity
        self._preview, self._history = options.preview, options.history
        self.delay = options.observation_delay
        span = f"{schedule.span:g} {schedule.unit}"
        pairs = zip(options.signals, self._scales, strict=True)
        self.rows = [
            *((f"measured {each.name}", f"{scale:g} {each.si_unit}") for each, scale in pairs),
            ("reference now", span),
            (f"reference now less measured {schedule.quantity}", span),
            *((f"reference {k} control steps ahead", span) for k in range(1, self._preview + 1)),
            *(
                (f"last {c.signal.name}", f"{c.limits[1]:g} {c.signal.si_unit}")
                for c in options.commands
            ),
            *(
                (f"{schedule.quantity} heard {k} control steps before", span)
                for k in range(1, self._history + 1)
            ),
        ]
        self.space = spaces.Box(-BOUND, BOUND, (len(self.rows),), np.float32)

    def entries(
        self,
        reading: Callable[[str, int], Any],
        reference: Callable[[int], Any],
        action: Sequence[Any],
        prescribed: Prescribed | None = None,
    ) -> list[Any]:
        """Compute the entries before clipping; see `ObservationTable.entries`."""
        share = 1.0 / self._span

        def followed(steps: int) -> Any:  # noqa: ANN401
            return reading(f"read_{self._quantity}", steps) * share

        measured = [
            reading(f"read_{name}", self.delay) * (1.0 / scale)
            for name, scale in zip(self._names, self._scales, strict=True)
        ]
        now = reference(0) * share
        return [
            *measured,
            now,
            now - followed(self.delay),
            *(reference(k) * share for k in range(1, self._preview + 1)),
            *action,
            *(followed(self.delay + k) for k in range(1, self._history + 1)),
        ]
