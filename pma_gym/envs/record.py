"""What an environment remembers between two steps: a row of numbers, in named places."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from pma_gym.envs.options import Options
from pma_gym.kernels.graph import Kind
from pma_gym.tasks import Task

Part = Literal["extension", "rotation", "load", "pressure"]
PARTS: tuple[Part, ...] = ("extension", "rotation", "load", "pressure")
"""What a reading consists of, in order."""

START = "start_contraction"
"""Place of the contraction that an episode began at (m), from which a regulator's task counts."""

OPERATOR = "memory_operator"
"""Place of the force that an operator puts on the slide (N)."""

TRUTH = ("contraction", "rotation", "load", "pressure")
"""True outputs, in the order of the plant's."""


@dataclass(frozen=True)
class Record:
    """Places of an environment's numbers.

    Attributes:
        states: names of the plant's states and memories.
        task: the task.
        options: the environment's options.
    """

    states: tuple[str, ...]
    task: Task
    options: Options

    @property
    def actions(self) -> int:
        """Entries of an action."""
        return 2 if self.options.regulator_action else 1

    @property
    def readings(self) -> int:
        """Readings that are kept: as many as are on the way, and as are observed."""
        return self.options.observation_delay + self.options.history + 1

    @property
    def info(self) -> list[str]:
        """Keys of a step's info that are numbers, in order."""
        unit, quantity = self.task.protocol.unit, self.task.protocol.quantity
        return [
            "time_s",
            f"{quantity}_{unit}",
            f"measured_{quantity}_{unit}",
            f"reference_{unit}",
            f"error_{unit}",
            "motor_voltage_v",
            "regulator_voltage_v",
            "pressure_kpa",
            "load_n",
            "extrapolated",
        ]

    @property
    def held(self) -> list[str]:
        """What the march needs that stays during a control step."""
        own = [START] if self.task.actuator == "regulator" else []
        return ["motor_voltage", "regulator_voltage", "zero_contraction", *own]

    @cached_property
    def events(self) -> list[str]:
        """Places of what disturbs: of each event its control step and its size.

        The step is a whole number, kept as a real: which is the same in every precision.
        """
        disturbing, duration = self.options.disturbing, self.task.duration
        steps, pulses = disturbing.regulator_steps(duration), disturbing.pulses(duration)
        return [
            *(f"{what}_{i}" for i in range(steps) for what in ("jump_step", "jump")),
            *(f"{what}_{i}" for i in range(pulses) for what in ("pulse_step", "pulse")),
        ]

    @cached_property
    def places(self) -> dict[str, int]:
        """Place of every number by name."""
        delay = self.options.action_delay
        names = [
            *self.states,
            *("size", "zero_contraction", "motor_voltage", "regulator_voltage"),
            *(("rest_motor", START) if self.task.actuator == "regulator" else ()),
            *self.events,
            *("rest_regulator", "count", "sample", "tare_contraction", "tare_rotation"),
            *("key_0", "key_1", "episode"),
            *(f"sum_{phase.name}" for phase in self.task.protocol.phases),
            *(f"action_{i}" for i in range(self.actions)),
            *(f"wire_{k}_{i}" for k in range(delay) for i in range(self.actions)),
            *(f"{part}_{k}" for k in range(self.readings) for part in PARTS),
            *(f"true_{name}" for name in TRUTH),
            "ended",
            *self.info,
            "reward",
        ]
        return {name: i for i, name in enumerate(names)}

    def kind(self, name: str) -> Kind:
        """Kind of a number: counts and the random numbers' key are integers."""
        return "integer" if name in ("count", "key_0", "key_1", "episode") else "real"

    @property
    def size(self) -> int:
        """How many numbers there are."""
        return len(self.places)
