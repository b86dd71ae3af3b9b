"""An exercise's part of a control step, as traced arithmetic: operator, safety filter, score.

The numbers that a control step reads, as inputs of its graph.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from pma_gym.codegen.generic import to_real, where
from pma_gym.codegen.graph import CHANGING, HELD, Graph, Value
from pma_gym.engine.actions import HIGHEST_VOLTAGE
from pma_gym.engine.observation import Prescribed
from pma_gym.engine.state_layout import FILTER_STATE, NOISE, START, StateLayout, profile_at_offsets
from pma_gym.integrator.equations import COMMANDS, ZERO, Equations
from pma_gym.tasks import PACE, MomentProfile, Operator, OperatorState, unsafe
from pma_gym.tasks.operator import FORESIGHT_S, operator_step, unsteady
from pma_gym.tasks.safety_filter import MOMENT_FILTER_S, SPEED_FILTER_S, filtered_pressure
from pma_gym.units import SI_FACTORS


@dataclass(frozen=True)
class StepInputs:
    """Inputs of a control step by name.

    Attributes:
        state_layout: places of the numbers.
        equations: the plant's equations, whose graph all of it is in.
    """

    state_layout: StateLayout
    equations: Equations

    @property
    def graph(self) -> Graph:
        """The graph of all values."""
        return self.equations.graph

    def slot(self, name: str) -> Value:
        """A number of the record, as an input; states and commands are the plant's own."""
        if name in self.state_layout.states or name in (*COMMANDS, ZERO):
            return self.equations[name]
        if name == START or name in self.state_layout.prescribed:
            return self.graph.input(name, HELD)
        return self.graph.input(f"record.{name}", CHANGING, self.state_layout.kind(name))

    def action(self, i: int) -> Value:
        """An entry of the action, as an input."""
        return self.graph.input(f"action.{i}", CHANGING)

    def reference(self, steps_ahead: int) -> Value:
        """The reference so many steps after the one that begins (m or rad), as an input."""
        return self.graph.input(f"reference.{steps_ahead}", CHANGING)

    @property
    def horizon(self) -> Value:
        """Control steps after which an episode is truncated, as an input."""
        return self.graph.input("horizon", CHANGING)


def held_volts(volts: Value) -> Value:
    """Limit a voltage to the range of drive and regulator, 0 to 10 V."""
    return where(volts < 0.0, 0.0, where(volts > HIGHEST_VOLTAGE, HIGHEST_VOLTAGE, volts))


class ExerciseStep:
    """The operator of an exercise, its safety filter and its score.

    Args:
        inputs: of the control step that it belongs to.
    """

    def __init__(self, inputs: StepInputs) -> None:
        self.inputs, self.state_layout = inputs, inputs.state_layout
        exercise = self.state_layout.task.exercise
        assert exercise is not None
        self.exercise = exercise
        self.period = self.state_layout.options.period

    # -- what the rig's computer knows -------------------------------------------------------------

    @property
    def operator(self) -> Operator:
        """The operator's numbers, as inputs."""
        return Operator(*(self.inputs.slot(f"operator_{name}") for name in Operator._fields))  # type: ignore[arg-type]

    @property
    def plan(self) -> MomentProfile:
        """Moment that the operator expects over the angle, as inputs."""
        return profile_at_offsets(self.inputs.slot, self.exercise)

    @property
    def prescribed(self) -> Prescribed | None:
        """The prescribed moment; None if the exercise prescribes the speed."""
        if self.exercise.prescription is None:
            return None
        return Prescribed(self.inputs.slot("nominal_radius"), self.plan)

    # -- operator ----------------------------------------------------------------------------------

    def operate(self) -> dict[str, Value]:
        """Compute the operator's motor voltage in the step, and the operator's new state."""
        slot, operator = self.inputs.slot, self.operator
        count = slot("count")
        time = to_real(count) * self.period
        intended = self._intended(time - operator.reaction)
        angle = slot("true_rotation")
        zero = self.inputs.graph.constant(0, "integer")
        key = slot("key_0"), slot("key_1")
        normal = unsteady(count, slot("episode") * 4 + NOISE, key, zero)
        moment, operator_state = operator_step(
            operator,
            OperatorState(*(slot(f"operator_state_{name}") for name in OperatorState._fields)),
            operator.effort * self.plan.at(intended),
            intended - angle,
            angle + FORESIGHT_S * slot("spin"),
            time,
            normal,
            self.period,
            slot("operator_share"),
        )
        load = moment / slot("nominal_radius")
        volts = (load - slot("nominal_drive_offset")) / slot("nominal_drive_gain")
        new = {f"operator_state_{name}": value for name, value in operator_state._asdict().items()}
        return new | {"motor_voltage": held_volts(volts), "operator_moment": moment}

    def _intended(self, time: Value) -> Value:
        """Angle that an operator intends, by a time that includes his reaction (rad)."""
        angle = self.inputs.graph.constant(0.0)
        for phase in PACE.phases:
            since = time - phase.start
            late = where(since < 0.0, 0.0, where(since > phase.duration, phase.duration, since))
            if phase.slope:
                angle = angle + phase.slope * late
        return angle

    # -- safety ------------------------------------------------------------------------------------

    def keep_safe(self, volts: Value) -> tuple[Value, dict[str, Value]]:
        """Compute the regulator voltage after the safety filter, and the filter's new state."""
        if not self.state_layout.options.safety:
            return volts, {}
        # It stands at the rig: delays lie between the agent and it.
        slot = self.inputs.slot
        extension = slot("extension_0")
        radius = slot("nominal_radius")
        rate = (extension - slot("safety_extension")) / (self.period * radius)
        speed = self._filtered("safety_speed", rate, SPEED_FILTER_S)
        moment = radius * slot("load_0")
        slow = self._filtered("safety_moment", moment, MOMENT_FILTER_S)
        gain, offset = slot("nominal_line_gain"), slot("nominal_line_offset")
        before = slot("safety_pressure")
        pressure = filtered_pressure(
            gain * volts + offset,
            before,
            moment,
            slow,
            speed,
            slot("rotation_0"),
            self.exercise.safe_moment,
            self.exercise.safe_speed,
            self.exercise.safety_filter,
        )
        there = before + slot("nominal_lag_share") * (pressure - before)
        new = (there, extension, speed, slow)
        filter_state: dict[str, Value] = dict(zip(FILTER_STATE, new, strict=True))
        return held_volts((pressure - offset) / gain), filter_state

    def _filtered(self, name: str, value: Value, time_constant: float) -> Value:
        kept = math.exp(-self.period / time_constant)
        return kept * self.inputs.slot(name) + (1.0 - kept) * value

    # -- score -------------------------------------------------------------------------------------

    def score(self, sensed: Mapping[str, Value], first: bool) -> dict[str, Value]:
        """Compute the score after a step: new numbers by name.

        Args:
            sensed: the step's truth, and whether it broke a limit of the rig.
            first: at the trial's beginning, where nothing has been done yet.
        """
        eq, slot = self.inputs.equations, self.inputs.slot
        moment, speed = eq.parameters["rotor"].radius * sensed["true_load"], slot("spin")
        if first:
            return {"ended": self.inputs.graph.value(sensed["ended"])}
        power = moment * speed
        new: dict[str, Value] = {}
        for name, value in (
            ("peak_moment", moment),
            ("peak_speed", abs(speed)),
            ("peak_power", abs(power)),
        ):
            before = slot(name)
            new[name] = where(value > before, value, before)
        done = power * self.period
        new["work"] = slot("work") + where(done > 0.0, done, 0.0)
        new["returned"] = slot("returned") + where(done < 0.0, -done, 0.0)
        new |= self._pace(sensed)
        rig = sensed["ended"]
        broken = unsafe(self.exercise, moment, speed)
        return new | {"ended": where(rig > 0.0, rig, broken)}

    def _pace(self, sensed: Mapping[str, Value]) -> dict[str, Value]:
        """Sums of squared errors of the angle by phase, at the control steps' ends (rad^2)."""
        time = to_real(sensed["count"]) * self.period
        new = {}
        for phase in PACE.phases:
            error = sensed["true_rotation"] - (phase.initial + phase.slope * (time - phase.start))
            end = phase.start + phase.duration
            # Half a step beside the edges: times are whole steps, but for rounding.
            edge = 0.5 * self.period
            inside = (time > phase.start + edge) & (time < end + edge)
            before = self.inputs.slot(f"pace_{phase.name}")
            new[f"pace_{phase.name}"] = where(inside, before + error * error, before)
        return new

    def info(self, sensed: Mapping[str, Value]) -> list[Value]:
        """An exercise's own numbers of the info, in order."""
        eq, degree = self.inputs.equations, SI_FACTORS["deg"]
        moment = eq.parameters["rotor"].radius * sensed["true_load"]
        speed, rotation = self.inputs.slot("spin"), sensed["true_rotation"]
        other = []
        if self.exercise.prescription:
            other = [rotation * (1.0 / degree), self.plan.at(rotation)]
        asked = self.inputs.slot("operator_moment")
        return [*other, moment, asked, speed * (1.0 / degree), moment * speed]
