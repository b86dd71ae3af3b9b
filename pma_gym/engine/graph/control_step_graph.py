"""A control step without the plant, as traced arithmetic for kernels of any width.

From the action to the drive, from the plant's state to reading, observation, reward and end.
"""

from collections.abc import Mapping
from functools import cached_property

from pma_gym.codegen.generic import to_real, where
from pma_gym.codegen.graph import Value
from pma_gym.codegen.random import normals, philox
from pma_gym.codegen.trace import substitute
from pma_gym.engine.actions import HIGHEST_VOLTAGE
from pma_gym.engine.graph.exercise_step import ExerciseStep, StepInputs, held_volts
from pma_gym.engine.graph.scoring import position_of
from pma_gym.engine.observation import BOUND, ObservationTable, Prescribed, measured_position
from pma_gym.engine.state_layout import NOISE, PARTS, TRUTH
from pma_gym.integrator.integration import step_start_values
from pma_gym.integrator.step_attempt import first_size
from pma_gym.plant import sensors
from pma_gym.tasks import REWARDS, broken, missed_reward
from pma_gym.units import SI_FACTORS

FORCE_OF_A_VOLT = 100.0
"""Jump of the hand's force (N) after which steps begin as small as after one of 1 V: about what
the motor pulls with."""

PRESSURE_TOLERANCE = 1.0
"""How far a pressure may leave the trials' range before it counts (Pa): a settled pressure is
exact to its last bits only."""


class ControlStepGraph(StepInputs):
    """Traced parts of a control step; see `StepInputs` for arguments and attributes."""

    @cached_property
    def exercise_step(self) -> ExerciseStep | None:
        """The exercise's part of the step."""
        return ExerciseStep(self) if self.state_layout.task.exercise else None

    @property
    def prescribed(self) -> Prescribed | None:
        """The prescribed moment, in an exercise that has one."""
        return self.exercise_step.prescribed if self.exercise_step else None

    def command(self) -> dict[str, Value]:
        """Compute the commands at the station from an action: new numbers by name."""
        state_layout, options = self.state_layout, self.state_layout.options
        held = []
        for i in range(state_layout.actions):
            asked = self.action(i)
            held.append(where(asked < -1.0, -1.0, where(asked > 1.0, 1.0, asked)))
        new: dict[str, Value] = {f"action_{i}": value for i, value in enumerate(held)}
        volts = [self.asked(i, value) for i, value in enumerate(held)]
        if options.action_delay:
            received = [self.slot(f"wire_0_{i}") for i in range(state_layout.actions)]
            line = [
                [self.slot(f"wire_{k}_{i}") for i in range(state_layout.actions)]
                for k in range(1, options.action_delay)
            ]
            for k, values in enumerate([*line, volts]):
                new |= {f"wire_{k}_{i}": value for i, value in enumerate(values)}
        else:
            received = volts
        new |= self.received(received)
        change = self.graph.constant(0.0)
        for i, value in enumerate(held):
            moved = abs(value - self.slot(f"action_{i}"))
            change = where(moved > change, moved, change)
        new["reward"] = change
        jump = abs(new["motor_voltage"] - self.slot("motor_voltage"))
        other = abs(new["regulator_voltage"] - self.slot("regulator_voltage"))
        jump = where(other > jump, other, jump)
        if any(name.startswith("pulse_") for name in self.state_layout.events):
            push = state_layout.push
            new[push] = self.pushed()
            pulled = abs(new[push] - self.slot(push)) * (1.0 / FORCE_OF_A_VOLT)
            jump = where(pulled > jump, pulled, jump)
        new["size"] = first_size(self.slot("size"), jump)
        return new

    def asked(self, i: int, action: Value) -> Value:
        """Command that an entry of an action asks for (V)."""
        return 0.5 * HIGHEST_VOLTAGE * (action + 1.0)

    def received(self, volts: list[Value]) -> dict[str, Value]:
        """Commands of motor and regulator for those that have arrived (V)."""
        options, new = self.state_layout.options, {}
        if self.exercise_step:
            regulator, filtered = self.exercise_step.keep_safe(volts[0])
            new |= self.exercise_step.operate() | filtered
        elif self.state_layout.task.actuator == "regulator":
            new["motor_voltage"], regulator = self.slot("rest_motor"), volts[0]
        else:
            new["motor_voltage"] = volts[0]
            regulator = volts[1] if options.regulator_action else self.slot("rest_regulator")
        new["regulator_voltage"] = self._disturbed(regulator)
        return new

    def _disturbed(self, regulator: Value) -> Value:
        """Regulator voltage at the station for a commanded one, disturbances included (V)."""
        jumps = [name for name in self.state_layout.events if name.startswith("jump_step_")]
        if not jumps:
            return regulator
        now, volts = to_real(self.slot("count")), regulator
        for name in jumps:
            size = self.slot(name.replace("_step", ""))
            volts = volts + where(now >= self.slot(name), size, 0.0)
        return held_volts(volts)

    def pushed(self) -> Value:
        """Force of the hand in the step that begins (N)."""
        now, force = to_real(self.slot("count")), self.graph.constant(0.0)
        for name in self.state_layout.events:
            if name.startswith("pulse_step_"):
                ended = self.slot(name.replace("_step", "_end"))
                during = (now >= self.slot(name)) & (now < ended)
                force = force + where(during, self.slot(name.replace("_step", "")), 0.0)
        return force

    def truth(self) -> dict[str, Value]:
        """True outputs at the plant's state."""
        eq = self.equations
        outputs = substitute(list(eq.outputs.values()), step_start_values(eq))
        return dict(zip(eq.outputs, outputs, strict=True))

    def read(self, stream: int, count: Value) -> list[Value]:
        """Measurements of the sensors (SI), with random numbers of a stream."""
        eq, signals = self.equations, self.state_layout.signals
        lagged = substitute([eq.readings[each.name] for each in signals], step_start_values(eq))
        if not self.state_layout.options.noise:
            return lagged
        key, drawn = (self.slot("key_0"), self.slot("key_1")), []
        # Four numbers of each counter.
        for block in range(0, len(signals), 4):
            own = self.slot("episode") * 4 + stream, self.graph.constant(block, "integer"), 0
            drawn += normals(philox((count, *own), key))
        said = []
        for held, normal, signal in zip(lagged, drawn, signals, strict=False):
            parameters = eq.parameters.get(signal.sensor)
            level = getattr(parameters, "noise", self.graph.constant(0.0))
            said.append(sensors.reading(held, level, normal, signal.calibration))
        return said

    def sense(self, count: Value, first: bool) -> dict[str, Value]:
        """Compute measurement, end and info from the plant's state: new numbers by name.

        Args:
            count: control steps since the trial began, an integer.
            first: at the trial's beginning, which has no readings before.
        """
        state_layout, truth = self.state_layout, self.truth()
        contraction, rotation, load, pressure = self.read(NOISE, count)
        reading = {
            "extension": self.slot("tare_contraction") - contraction,
            "rotation": rotation - self.slot("tare_rotation"),
            "load": load,
            "pressure": pressure,
        }
        new: dict[str, Value] = {f"true_{name}": value for name, value in truth.items()}
        for k in range(state_layout.readings):
            for part in PARTS:
                before = reading[part] if k == 0 or first else self.slot(f"{part}_{k - 1}")
                new[f"{part}_{k}"] = before
        ended = broken(self.equations.parameters["limits"], truth)
        new["ended"] = self.graph.value(ended)
        new["count"] = count
        if self.exercise_step:
            new |= self.exercise_step.score(new, first)
        new |= self._info(new, to_real(count))
        return new

    def _info(self, sensed: Mapping[str, Value], count: Value) -> dict[str, Value]:
        state_layout, task = self.state_layout, self.state_layout.task
        unit, quantity = task.schedule.unit, task.schedule.quantity
        factor, position = 1.0 / SI_FACTORS[unit], self.position(sensed)
        valid = self.equations.parameters["validity"]
        low = where(valid.lowest < task.lowest_pressure, task.lowest_pressure, valid.lowest)
        high = where(valid.highest < task.highest_pressure, valid.highest, task.highest_pressure)
        pressure = sensed["true_pressure"]
        inside = (pressure >= low - PRESSURE_TOLERANCE) & (pressure <= high + PRESSURE_TOLERANCE)
        measured = measured_position(
            quantity,
            lambda part: sensed[f"{part}_{state_layout.options.observation_delay}"],
            self.prescribed,
        )
        values = [
            count * state_layout.options.period,
            position * factor,
            measured * factor,
            self.reference(0) * factor,
            (position - self.reference(0)) * factor,
            self.slot("motor_voltage"),
            self.slot("regulator_voltage"),
            pressure * 1e-3,
            sensed["true_load"],
            where(inside, 0.0, 1.0),
        ]
        if self.exercise_step:
            values += self.exercise_step.info(sensed)
        return dict(zip(state_layout.info, values, strict=True))

    @property
    def followed(self) -> Value:
        """Position of the task's controlled quantity within a step attempt (m or rad)."""
        return position_of(self.equations, self.state_layout.task, self.equations.outputs)

    def position(self, sensed: Mapping[str, Value]) -> Value:
        """True position of the task's controlled quantity (m or rad)."""
        outputs = {name: sensed[f"true_{name}"] for name in TRUTH}
        return position_of(self.equations, self.state_layout.task, outputs)

    def first_score(self, sensed: Mapping[str, Value]) -> dict[str, Value]:
        """The score's numbers once the first sample, that of the beginning, is taken."""
        phase = self.state_layout.task.schedule.phases[0]
        error = self.position(sensed) - float(phase.reference(0.0))
        return {"sample": self.graph.constant(1.0), f"sum_{phase.name}": error * error}

    def reward(self, sensed: Mapping[str, Value]) -> Value:
        """Reward of a step; the action's change stands where the reward will.

        It stays there for a user's function, which Python calls (`FunctionRewards`).
        """
        task, options = self.state_layout.task, self.state_layout.options
        if callable(options.reward):
            return self.slot("reward")
        rule = REWARDS[options.reward]
        error = self.position(sensed) - self.reference(0)
        value = self.graph.value(rule(task.error_percent(error), self.slot("reward")))
        missed = self.horizon - to_real(sensed["count"])
        whole = where(sensed["ended"] > 0.0, value + missed * missed_reward(rule), value)
        # By 1 it is the same, and takes its time.
        return whole if options.reward_scale == 1.0 else options.reward_scale * whole

    def observation(self, table: ObservationTable, sensed: Mapping[str, Value]) -> list[Value]:
        """The observation's entries."""
        entries = table.entries(
            lambda part, k: sensed[f"{part}_{k}"],
            self.reference,
            [self.slot(f"action_{i}") for i in range(self.state_layout.actions)],
            self.prescribed,
        )
        return [where(e < -BOUND, -BOUND, where(e > BOUND, BOUND, e)) for e in entries]
