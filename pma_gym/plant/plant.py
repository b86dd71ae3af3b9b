"""A plant that runs: settles, steps, simulates whole trials."""

import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from pma_gym.data.trial import Trial
from pma_gym.plant import sensors, settle
from pma_gym.plant.compiled import compile_module, import_text
from pma_gym.plant.compose import Equations
from pma_gym.plant.integrate import DEFAULT_STEP_S, module_text
from pma_gym.plant.model import PLANTS, Model, load_model

if TYPE_CHECKING:
    import control
    import sympy

NO_SAMPLES = np.zeros((0, 0))
OUTPUTS = ("contraction", "rotation", "load", "pressure")


@dataclass
class Condition:
    """Where a plant stands.

    Attributes:
        state: the state vector (SI), changed in place by `Plant.step`.
        zero_contraction: contraction x0 at which the trial began with no load (m); extension is
            counted from it.
        time: time since the trial began (s).
    """

    state: np.ndarray
    zero_contraction: float
    time: float = 0.0


class Plant:
    """A model's equations of motion, compiled.

    Args:
        model: a Model, the name of a shipped one, or the path of a TOML file.
        step: largest internal time step (s).
        compiled: False runs the laws as plain Python, some hundred times slower, for debugging;
            the results are the same bits.

    Attributes:
        model: the Model.
        states: names of the states, in the order of the state vector.
        decaying: the states whose rate law names a decay.
        outputs: names of the true outputs: contraction (m), rotation (rad), load (N),
            pressure (Pa).

    Example:
        >>> plant = Plant("serres2008")
        >>> rest = plant.settle(motor_voltage=0.0, pressure=300e3)
        >>> round(rest.zero_contraction * 1e3, 1)
        39.8
    """

    def __init__(
        self,
        model: str | Path | Model = "serres2008",
        step: float = DEFAULT_STEP_S,
        compiled: bool = True,
    ) -> None:
        """Compile the model's equations, or load them from the cache."""
        self.model = load_model(model)
        self.step_limit = step
        self.text, equations = _written(self.model)
        self.states = [state.name for state in equations.states]
        self.decaying = {state.name for state in equations.states if state.decay}
        self._warn_of_large_steps()
        self._module = compile_module(self.text) if compiled else import_text(self.text)
        self.vector = self.model.vector()
        self.outputs = OUTPUTS
        self.sensor_columns = [
            self.states.index(f"lag_{name}") if f"lag_{name}" in self.states else -1
            for name in sensors.SENSORS
        ]

    @cached_property
    def plain(self) -> ModuleType:
        """The same equations as an uncompiled Python module, for debugging."""
        return import_text(self.text)

    def _warn_of_large_steps(self) -> None:
        # Decays are integrated exactly; what swings is not, and is quietly wrong before it bursts.
        frequency = PLANTS[self.model.plant].fastest_oscillation(self.model.parameters)
        if frequency * self.step_limit > 1.0:
            warnings.warn(
                f"model {self.model.name} swings at {frequency:.3g} rad/s, too fast for steps of "
                f"{self.step_limit:g} s; give Plant a step of at most {0.1 / frequency:.1g}",
                stacklevel=3,
            )

    def regulator_voltage(self, pressure: float) -> float:
        """Regulator voltage (V) that settles at a pressure (Pa).

        Raises:
            ValueError: if the regulator would need less than 0 or more than 10 V.
        """
        line = self.model.parameters["regulator_line"]
        voltage = (pressure - line.offset) / line.gain
        if not 0.0 <= voltage <= 10.0:
            low, high = max(0.0, line.offset), 10.0 * line.gain + line.offset
            raise ValueError(
                f"pressure must lie in {low / 1e3:g} to {high / 1e3:g} kPa, what the regulator "
                f"reaches with 0-10 V; got {pressure / 1e3:g} kPa"
            )
        return voltage

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
            ValueError: neither pressure nor regulator voltage, a pressure that the regulator does
                not reach, or a load that the muscle cannot balance.
        """
        if regulator_voltage is None:
            if pressure is None:
                raise ValueError("settle needs a pressure (Pa) or a regulator_voltage (V)")
            regulator_voltage = self.regulator_voltage(pressure)
        state, zero = settle.at_rest(self, motor_voltage, regulator_voltage)
        return Condition(state, zero)

    def derivative(
        self,
        state: np.ndarray,
        motor_voltage: float,
        regulator_voltage: float,
        zero_contraction: float,
    ) -> np.ndarray:
        """Time derivative of the state vector (SI per s)."""
        out = np.empty_like(state)
        self._module.derivative(
            state, motor_voltage, regulator_voltage, zero_contraction, self.vector, out
        )
        return out

    def step(
        self,
        condition: Condition,
        motor_voltage: float,
        regulator_voltage: float,
        duration: float,
        period: float = 0.0,
        samples: np.ndarray = NO_SAMPLES,
    ) -> None:
        """Hold the commands for a while; changes the condition in place.

        Args:
            condition: where the plant stands.
            motor_voltage: motor command (V).
            regulator_voltage: regulator command (V).
            duration: how long (s).
            period: if positive, write the state at every multiple of it (s) into
            samples: array of shape (multiples, states).
        """
        substeps = max(1, math.ceil(duration / self.step_limit - 1e-6))
        self._module.advance(
            condition.state,
            motor_voltage,
            motor_voltage,
            regulator_voltage,
            regulator_voltage,
            condition.time,
            duration,
            substeps,
            condition.zero_contraction,
            self.vector,
            period,
            samples,
        )
        condition.time += duration

    def observe(self, states: np.ndarray, zero_contraction: float) -> dict[str, np.ndarray]:
        """True outputs of states.

        Args:
            states: shape (rows, states).
            zero_contraction: contraction x0 that extension counts from (m).
        Returns:
            contraction, rotation, load, pressure and extension (SI), shape (rows,) each.
        """
        out = np.empty((states.shape[0], len(OUTPUTS)))
        self._module.observe(states, 0.0, 0.0, zero_contraction, self.vector, out)
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
        period: float = 0.0,
        samples: np.ndarray = NO_SAMPLES,
    ) -> tuple[np.ndarray, float]:
        """States at each time under given commands.

        Args:
            time: increasing times (s), shape (n,).
            motor_voltage: motor commands (V), shape (n,).
            regulator_voltage: regulator commands (V), shape (n,).
            joined: join commands linearly between times; else hold each until the next.
            condition: where to begin; settled at the first commands if not given.
            period: as `step`.
            samples: as `step`.
        Returns:
            States of shape (n, states) and the contraction x0 that extension counts from (m).
        """
        first = condition or self.settle(
            float(motor_voltage[0]), regulator_voltage=float(regulator_voltage[0])
        )
        states = np.empty((len(time), len(self.states)))
        self._module.simulate(
            np.ascontiguousarray(time, dtype=float),
            np.ascontiguousarray(motor_voltage, float),
            np.ascontiguousarray(regulator_voltage, float),
            joined,
            self.step_limit,
            first.state.copy(),
            first.zero_contraction,
            self.vector,
            period,
            samples,
            states,
        )
        return states, first.zero_contraction

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


def _written(model: Model) -> tuple[str, Equations]:
    """The model's equations, and their text as a module."""
    plant = PLANTS[model.plant]
    equations = Equations(effects=model.effects)
    plant.write_equations(equations)
    text = module_text(equations, plant.OUTPUTS, model.lengths(), plant.FIRST_PARTS)
    return text, equations
