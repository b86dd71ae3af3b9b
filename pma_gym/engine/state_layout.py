"""Layout of an environment's state between two steps: a row of numbers at named offsets."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

from pma_gym.codegen.graph import Kind, Value
from pma_gym.data.signals import Signal
from pma_gym.engine.options import Options
from pma_gym.plant.rigs.station import STATION
from pma_gym.tasks import PACE, Exercise, MomentProfile, Operator, OperatorState, Task

PARTS: tuple[str, ...] = tuple(signal.reading or signal.name for signal in STATION.signals)
"""Components of a measurement, in order: extension, rotation, load, pressure."""

START = "start_contraction"
"""Name of the initial contraction of an episode (m), the zero of a regulator's task."""

HAND_PUSH = "memory_hand_push"
"""Name of the force with which a hand pushes the slide (N)."""

TRUTH = STATION.outputs
"""True outputs, in the order of the plant's."""


NOISE, TARE, DRAW, DISTURB = 0, 1, 2, 3
"""Streams of random numbers: sensors and an operator in a step, sensors at rest, what an episode
begins with, what disturbs it."""

PEAKS = ("peak_moment", "peak_speed", "peak_power")
"""Places of the greatest moment at a joint (N m), of its speed (rad/s) and of the power between
joint and device (W), either way, at the control steps' ends."""

WORK = ("work", "returned")
"""Places of the work that the joint did on the device and that it took back (J)."""

NOMINAL_STATION = (
    *("nominal_radius", "nominal_drive_gain", "nominal_drive_offset"),
    *("nominal_line_gain", "nominal_line_offset", "nominal_lag_share"),
)
"""Places of what the rig's computer knows of its station, drawn or not (SI): it plays the operator,
and keeps the exercise safe. `nominal_lag_share` is how far the pressure goes in a control step."""

FILTER_STATE = ("safety_pressure", "safety_extension", "safety_speed", "safety_moment")
"""Offsets of the safety layer's state: the pressure that the nominal regulator has come to
(Pa), the last measured extension (m), the estimated speed (rad/s), the moment of late
(N m)."""


def profile_at_offsets(number: Callable[[str], Value], exercise: Exercise) -> MomentProfile:
    """Build an operator's planned moment from the numbers of `StateLayout.plan`.

    Args:
        number: gives the value of a place.
        exercise: whose plan it is.
    """
    return MomentProfile(
        number("plan_first"),
        [number(f"plan_angle_{i}") for i in range(exercise.knots)],
        [number(f"plan_slope_{i}") for i in range(exercise.knots - 1)],
    )


@dataclass(frozen=True)
class StateLayout:
    """Offsets of an environment's numbers.

    Attributes:
        states: names of the plant's states and memories.
        task: the task.
        options: the environment's options.
    """

    states: tuple[str, ...]
    task: Task
    options: Options

    @property
    def signals(self) -> tuple[Signal, ...]:
        """The measured signals."""
        return STATION.signals

    @property
    def parts(self) -> tuple[str, ...]:
        """Components of a measurement, in order."""
        return PARTS

    @property
    def push(self) -> str:
        """Name of the force that disturbances push with."""
        return HAND_PUSH

    @property
    def recorded(self) -> str:
        """Command that a single environment writes down in every step."""
        return f"{self.task.actuator}_voltage"

    @property
    def actions(self) -> int:
        """Entries of an action."""
        return 2 if self.options.regulator_action else 1

    @property
    def readings(self) -> int:
        """Number of stored measurements, for the delay and the observed history."""
        return self.options.observation_delay + self.options.history + 1

    @property
    def info(self) -> list[str]:
        """Keys of a step's info that are numbers, in order."""
        unit, quantity = self.task.schedule.suffix, self.task.schedule.quantity
        common = [
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
        if self.task.exercise is None:
            return common
        other = ["rotation_deg", "prescribed_nm"] if self.task.exercise.prescription else []
        return [*common, *other, "moment_nm", "operator_nm", "speed_deg_s", "power_w"]

    @property
    def held(self) -> list[str]:
        """Inputs of the integration that are constant during a control step."""
        own = [START] if self.task.actuator == "regulator" else []
        return ["motor_voltage", "regulator_voltage", "zero_contraction", *own, *self.prescribed]

    @property
    def prescribed(self) -> list[str]:
        """Places of the operator's plan, where it is what the moment is compared with."""
        exercise = self.task.exercise
        return self.plan if exercise and exercise.prescription else []

    @property
    def plan(self) -> list[str]:
        """Places of the operator's plan: first moment (N m), angles (rad), slopes (N m/rad)."""
        if self.task.exercise is None:
            return []
        knots = self.task.exercise.knots
        return [
            "plan_first",
            *(f"plan_angle_{i}" for i in range(knots)),
            *(f"plan_slope_{i}" for i in range(knots - 1)),
        ]

    @property
    def operator(self) -> list[str]:
        """Places of an exercise's operator, of its safety and of its score."""
        if self.task.exercise is None:
            return []
        return [
            *(f"operator_{name}" for name in Operator._fields),
            "operator_share",
            *self.plan,
            *NOMINAL_STATION,
            *(f"operator_state_{name}" for name in OperatorState._fields),
            *(FILTER_STATE if self.options.safety else ()),
            "operator_moment",
            *PEAKS,
            *WORK,
            *(f"pace_{phase.name}" for phase in PACE.phases),
        ]

    @cached_property
    def events(self) -> list[str]:
        """Names of the disturbances' numbers: step and size of each event, and the end of a pulse.

        A step is a whole number, kept as a real: which is the same in every precision.
        """
        disturbing, duration = self.options.disturbing, self.task.duration
        steps, pulses = disturbing.regulator_steps(duration), disturbing.pulses(duration)
        return [
            *(f"{what}_{i}" for i in range(steps) for what in ("jump_step", "jump")),
            *(
                f"{what}_{i}"
                for i in range(pulses)
                for what in ("pulse_step", "pulse_end", "pulse")
            ),
        ]

    @cached_property
    def offsets(self) -> dict[str, int]:
        """Offset of every number by name."""
        delay = self.options.action_delay
        names = [
            *self.states,
            *("size", "zero_contraction", "motor_voltage", "regulator_voltage"),
            *(("rest_motor", START) if self.task.actuator == "regulator" else ()),
            *self.events,
            *self.operator,
            *("rest_regulator", "count", "sample", "tare_contraction", "tare_rotation"),
            *("key_0", "key_1", "episode"),
            *(f"sum_{phase.name}" for phase in self.task.schedule.phases),
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
        """Number of numbers in the row."""
        return len(self.offsets)
