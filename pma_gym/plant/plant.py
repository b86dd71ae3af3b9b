"""A plant that runs: settles, steps, simulates whole trials."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pma_gym.data.trial import Trial
from pma_gym.integrator.step_attempt import first_size
from pma_gym.plant import sensors
from pma_gym.plant.equilibrium import settling
from pma_gym.plant.model import Model, load_model
from pma_gym.plant.program import FIRST_S, program, table, vector
from pma_gym.plant.simulation import Run, simulate_all

if TYPE_CHECKING:
    import control
    import sympy

DEFAULT_TOLERANCE = 2.3e-4
"""Largest error of an internal step, as a share of the states' scales, chosen by measured error:
`python -m benchmarks accuracy` holds the result against scipy at rtol 1e-11."""

OUTPUTS = ("contraction", "rotation", "load", "pressure")


@dataclass
class Condition:
    """Where a plant stands.

    Attributes:
        state: the state vector (SI), changed in place by `Plant.step`.
        zero_contraction: contraction x0 at which the trial began with no load (m); extension is
            counted from it.
        time: time since the trial began (s).
        size: size that the next internal step will have (s), if its error allows.
        commands: motor and regulator voltage that it heard last (V), or None.
    """

    state: np.ndarray
    zero_contraction: float
    time: float = 0.0
    size: float = FIRST_S
    commands: tuple[float, float] | None = None

    def hear(self, motor_voltage: float, regulator_voltage: float) -> None:
        """Take commands (V) in: where they jump, the next internal step begins smaller."""
        commands = (motor_voltage, regulator_voltage)
        before = self.commands or commands
        jump = max(abs(new - old) for new, old in zip(commands, before, strict=True))
        self.size, self.commands = first_size(self.size, jump), commands


class Plant:
    """A model's equations of motion, compiled.

    Args:
        model: a Model, the name of a shipped one, or the path of a TOML file.
        tolerance: largest error of an internal step, as a share of what the plant's states are
            counted against; a station's positions are held to 0.1 % of it.

    Attributes:
        model: the Model.
        tolerance: the tolerance.
        program: the compiled functions of all models of this structure.
        vector: tolerance and parameters, as compiled functions read them.
        table: what is fixed for a model, as compiled functions read it.
        states: names of the states, in the order of the state vector.
        outputs: names of the true outputs: contraction (m), rotation (rad), load (N),
            pressure (Pa).

    Example:
        >>> plant = Plant("serres2008")
        >>> rest = plant.settle(motor_voltage=0.0, pressure=300e3)
        >>> round(rest.zero_contraction * 1e3, 1)
        39.8
    """

    def __init__(
        self, model: str | Path | Model = "serres2008", tolerance: float = DEFAULT_TOLERANCE
    ) -> None:
        """Compile the model's equations, or load them from the cache.

        Raises:
            ModelError: no such model, or one that cannot be used.
            ValueError: a tolerance that is none.
        """
        check_tolerance(tolerance)
        self.model = load_model(model)
        self.tolerance = tolerance
        self.program = program(self.model)
        self.states = list(self.program.states)
        self.vector = vector(self.model, tolerance)
        self.table = table(self.program, self.vector)
        self.outputs = OUTPUTS
        self.sensor_columns = [
            self.states.index(f"lag_{name}") if f"lag_{name}" in self.states else -1
            for name in sensors.SENSORS
        ]

    def __reduce__(self) -> "tuple[type[Plant], tuple[Model, float]]":
        """Copy and pickle by construction: compiled functions belong to their process."""
        return type(self), (self.model, self.tolerance)

    def regulator_voltage(self, pressure: float) -> float:
        """Regulator voltage (V) that settles at a pressure (Pa).

        Raises:
            ValueError: if the regulator would need less than 0 or more than 10 V.
        """
        return regulator_voltage(self.model, pressure)

    def settle(
        self,
        motor_voltage: float = 0.0,
        pressure: float | None = None,
        regulator_voltage: float | None = None,
    ) -> Condition:
        """The plant at rest at constant commands, memories at zero.

        Args:
            motor_voltage: motor command (V).
            pressure: gauge pressure (Pa); or instead
            regulator_voltage: regulator command (V).
        Returns:
            The settled condition.
        Raises:
            ValueError: neither pressure nor regulator voltage, a voltage out of 0-10 V, a pressure
                that the regulator does not reach, or a load that the muscle cannot balance.
        """
        if regulator_voltage is None:
            if pressure is None:
                raise ValueError("settle needs a pressure (Pa) or a regulator_voltage (V)")
            regulator_voltage = self.regulator_voltage(pressure)
        check_voltages(motor_voltage, regulator_voltage)
        state, zero = settling.at_rest(self, motor_voltage, regulator_voltage)
        return Condition(state, zero, commands=(motor_voltage, regulator_voltage))

    def derivative(
        self,
        state: np.ndarray,
        motor_voltage: float,
        regulator_voltage: float,
        zero_contraction: float,
    ) -> np.ndarray:
        """Time derivative of the state vector (SI per s)."""
        inputs = np.array([motor_voltage, regulator_voltage, zero_contraction], float)
        state, out = np.ascontiguousarray(state, float), np.empty(len(self.states))
        addresses = (a.ctypes.data for a in (state, inputs, self.vector))
        self.program.derivative(1, *addresses, 0, out.ctypes.data)
        return out

    def step(
        self,
        condition: Condition,
        motor_voltage: float,
        regulator_voltage: float,
        duration: float,
    ) -> None:
        """Hold the commands for a while; changes the condition in place.

        Args:
            condition: where the plant stands.
            motor_voltage: motor command (V).
            regulator_voltage: regulator command (V).
            duration: how long (s).
        Raises:
            ValueError: a voltage out of 0-10 V, or a duration that is not positive.
        """
        check_voltages(motor_voltage, regulator_voltage)
        if not 0.0 < duration < float("inf"):
            raise ValueError(f"duration must be a positive time in s, got {duration!r}")
        condition.hear(motor_voltage, regulator_voltage)
        run = Run(
            np.array([0.0, duration]),
            np.full(2, motor_voltage, float),
            np.full(2, regulator_voltage, float),
            False,
            self.table,
            condition.state,
            condition.zero_contraction,
            condition.size,
        )
        simulate_all(self.program, [run])
        condition.state[:] = run.states[1]
        condition.size = run.size
        condition.time += duration

    def observe(self, states: np.ndarray, zero_contraction: float) -> dict[str, np.ndarray]:
        """True outputs of states.

        Args:
            states: shape (rows, states).
            zero_contraction: contraction x0 that extension counts from (m).
        Returns:
            contraction, rotation, load, pressure and extension (SI), shape (rows,) each.
        """
        states = np.ascontiguousarray(states, float)
        out = np.empty((states.shape[0], len(OUTPUTS)))
        addresses = (a.ctypes.data for a in (self.vector, out))
        self.program.observe(len(states), states.ctypes.data, zero_contraction, *addresses)
        truth = {name: out[:, i] for i, name in enumerate(OUTPUTS)}
        truth["extension"] = zero_contraction - truth["contraction"]
        return truth

    def run(
        self,
        time: np.ndarray,
        motor_voltage: np.ndarray,
        regulator_voltage: np.ndarray,
        joined: bool = True,
        condition: Condition | None = None,
    ) -> tuple[np.ndarray, float]:
        """States at each time under given commands.

        Args:
            time: increasing times (s), shape (n,).
            motor_voltage: motor commands (V), shape (n,).
            regulator_voltage: regulator commands (V), shape (n,).
            joined: join commands linearly between times; else hold each until the next.
            condition: where to begin; settled at the first commands if not given.
        Returns:
            States of shape (n, states) and the contraction x0 that extension counts from (m).
        """
        first = condition or self.settle(
            float(motor_voltage[0]), regulator_voltage=float(regulator_voltage[0])
        )
        run = Run(
            np.asarray(time, float),
            np.asarray(motor_voltage, float),
            np.asarray(regulator_voltage, float),
            joined,
            self.table,
            first.state,
            first.zero_contraction,
        )
        simulate_all(self.program, [run])
        return run.states, first.zero_contraction

    def simulate(
        self, trial: Trial, noise: bool = True, seed: int | None = 0, joined: bool = True
    ) -> Trial:
        """Run a trial's commands and log what the station's sensors would.

        Args:
            trial: time and commands: motor_voltage or load_command, regulator_voltage or
                pressure_command.
            noise: sensor noise and the DAQ's quantisation; the sensors' lag stays either way.
            seed: seed of the noise.
            joined: join commands linearly between rows; else hold each until the next.
        Returns:
            The trial with measurements and truth filled in.
        Raises:
            ValueError: a command that is missing, or not given in the first row; a later empty cell
                holds the value before it.
        """
        motor, regulator = sensors.voltages(self.model, trial)
        states, zero = self.run(trial.time, motor, regulator, joined)
        truth = self.observe(states, zero)
        generator = np.random.Generator(np.random.Philox(seed)) if noise else None
        measured = sensors.measure(self.model, self.lagged(states, truth), generator)
        provenance = dict(trial.provenance) | self.provenance(noise, seed)
        return Trial(
            time=trial.time,
            commands=trial.commands,
            measurements=measured,
            truth=truth,
            provenance=provenance,
        )

    def lagged(self, states: np.ndarray, truth: Mapping[str, np.ndarray]) -> np.ndarray:
        """What the sensors hold before noise, shape (rows, 4): the lag's state, or the truth."""
        columns = [
            states[:, at] if at >= 0 else truth[name]
            for at, name in zip(self.sensor_columns, OUTPUTS, strict=True)
        ]
        return np.stack(columns, axis=1)

    def provenance(self, noise: bool, seed: int | None) -> dict[str, str]:
        """What to write beside a result, so that it can be made again."""
        return {"model": self.model.name, "noise": str(noise), "seed": str(seed)}

    def linearize(
        self, pressure: float, contraction: float, direction: str = "relaxing"
    ) -> "control.StateSpace":
        """The plant near rest as a linear system; see `pma_gym.plant.linear.linearize`."""
        # Imported here: python-control takes longer to import than all of this package.
        from pma_gym.plant.linear import linearize

        return linearize(self, pressure, contraction, direction)

    def symbolic(self) -> "dict[str, sympy.Expr]":
        """The equations of motion; see `pma_gym.plant.symbolic.symbolic`."""
        from pma_gym.plant.symbolic import symbolic

        return symbolic(self)

    def extrapolates(self, pressure: float) -> bool:
        """Whether a pressure (Pa) lies outside what the model was identified on."""
        valid = self.model.parameters["validity"]
        return not valid.lowest <= pressure <= valid.highest


def regulator_voltage(model: Model, pressure: float) -> float:
    """Regulator voltage (V) of a model that settles at a pressure (Pa).

    Raises:
        ValueError: if the regulator would need less than 0 or more than 10 V.
    """
    line = model.parameters["regulator_line"]
    voltage = (pressure - line.offset) / line.gain
    if not 0.0 <= voltage <= 10.0:
        low, high = max(0.0, line.offset), 10.0 * line.gain + line.offset
        raise ValueError(
            f"pressure must lie in {low / 1e3:g} to {high / 1e3:g} kPa, what the regulator "
            f"reaches with 0-10 V; got {pressure / 1e3:g} kPa; give another pressure, or a model "
            "whose regulator reaches it"
        )
    return voltage


def check_tolerance(tolerance: object) -> None:
    """Refuse what is no tolerance of the integrator.

    Raises:
        ValueError: it is no number, or too small or large for one.
    """
    # `not`: NaN is out of every range, as is true or false.
    if not (isinstance(tolerance, int | float | np.floating) and 1e-10 <= tolerance <= 0.1):
        raise ValueError(
            f"tolerance must be a share in 1e-10 to 0.1 of the states' scales, got "
            f"{tolerance!r}; the default is {DEFAULT_TOLERANCE:g}"
        )


def check_voltages(motor_voltage: float, regulator_voltage: float) -> None:
    """Refuse commands that no drive or regulator takes.

    Raises:
        ValueError: names the command, what came, and what may.
    """
    for name, voltage in (("motor", motor_voltage), ("regulator", regulator_voltage)):
        # `not <=`: NaN is out of every range.
        if not 0.0 <= voltage <= 10.0:
            raise ValueError(f"{name}_voltage must lie in 0 to 10 V, got {voltage!r}")
