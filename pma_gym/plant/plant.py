"""The class `Plant`: equilibrium, steps and whole trials of a model."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from pma_gym.data.trial import Trial
from pma_gym.effects.effect import Effect
from pma_gym.integrator.equations import Interpolation, check_interpolation
from pma_gym.plant import sensors
from pma_gym.plant.compiled_model import CompiledModel
from pma_gym.plant.equilibrium.solver import equilibrium_at
from pma_gym.plant.memory_start import begun_at
from pma_gym.plant.simulation import Run, simulate_all
from pma_gym.plant.statics import Condition, check_commands

if TYPE_CHECKING:
    import control
    import sympy


class Plant(CompiledModel):
    """Find equilibria of a model, step it, simulate trials and linearise it.

    Its arguments and attributes are those of `CompiledModel`.

    Example:
        >>> plant = Plant("serres2008")
        >>> rest = plant.settle(motor_voltage=0.0, pressure=300e3)
        >>> round(rest.zero_contraction * 1e3, 1)
        39.8
    """

    def settle(
        self,
        motor_voltage: float = 0.0,
        pressure: float | None = None,
        regulator_voltage: float | None = None,
    ) -> Condition:
        """Return the equilibrium at constant commands, with the model's initial hysteresis states.

        A rig without an equilibrium, such as a joint, is at its model's initial position and speed.

        Args:
            motor_voltage: motor command (V, or the SI unit of the drive's command).
            pressure: gauge pressure (Pa), as an alternative to the regulator's voltage; neither is
                needed by a rig without a regulator.
            regulator_voltage: regulator command (V).
        Raises:
            ValueError: neither pressure nor regulator voltage for a regulator, a voltage out of
                0-10 V, a pressure that the regulator does not reach, or a load that the muscle
                cannot balance.
        """
        if regulator_voltage is None:
            if pressure is None and "regulator_line" in self.parameters:
                raise ValueError(
                    f"settle() needs a pressure (Pa) or a regulator_voltage (V) for the regulator "
                    f"of model {self.model.name}"
                )
            regulator_voltage = 0.0 if pressure is None else self.regulator_voltage(pressure)
        return equilibrium_at(self, motor_voltage, regulator_voltage)

    def step(
        self,
        condition: Condition,
        motor_voltage: float,
        regulator_voltage: float,
        duration: float,
    ) -> None:
        """Advance the condition in place under constant commands.

        Args:
            condition: present condition, changed in place.
            motor_voltage: motor command (V).
            regulator_voltage: regulator command (V).
            duration: time span (s).
        Raises:
            ValueError: a voltage out of 0-10 V, or a duration that is not positive.
        """
        check_commands(self.model, motor_voltage, regulator_voltage)
        if not 0.0 < duration < float("inf"):
            raise ValueError(f"duration must be a positive time in s, got {duration!r}")
        condition.receive(motor_voltage, regulator_voltage)
        run = Run(
            np.array([0.0, duration]),
            np.full(2, motor_voltage, float),
            np.full(2, regulator_voltage, float),
            "zoh",
            self.table,
            condition.state,
            condition.zero_contraction,
            condition.size,
        )
        simulate_all(self.program, [run])
        condition.state[:] = run.states[1]
        condition.size = run.size
        condition.time += duration

    def run(
        self,
        time: np.ndarray,
        motor_voltage: np.ndarray,
        regulator_voltage: np.ndarray,
        interpolation: Interpolation = "foh",
        condition: Condition | None = None,
    ) -> tuple[np.ndarray, float]:
        """Return the states at given times under given commands.

        Args:
            time: increasing times (s), shape (n,).
            motor_voltage: motor commands (V), shape (n,).
            regulator_voltage: regulator commands (V), shape (n,).
            interpolation: of the commands between rows: "foh" (first-order hold, linear) or
                "zoh" (each held until the next).
            condition: initial condition; the equilibrium at the first commands if not given.
        Returns:
            States, shape (n, states), and the contraction x0 that is the zero of extension (m).
        """
        check_interpolation(interpolation)
        first = condition or self.settle(
            float(motor_voltage[0]), regulator_voltage=float(regulator_voltage[0])
        )
        run = Run(
            np.asarray(time, float),
            np.asarray(motor_voltage, float),
            np.asarray(regulator_voltage, float),
            interpolation,
            self.table,
            first.state,
            first.zero_contraction,
        )
        simulate_all(self.program, [run])
        return run.states, first.zero_contraction

    def simulate(
        self,
        trial: Trial,
        noise: bool = True,
        seed: int | None = 0,
        interpolation: Interpolation = "foh",
    ) -> Trial:
        """Simulate a trial's commands and return the trial with the sensors' measurements.

        The simulation begins at the equilibrium of the first commands. Initial hysteresis states
        come from the trial or, if it has none, from the model.

        Args:
            trial: time and commands: motor_voltage or load_command, regulator_voltage or
                pressure_command.
            noise: add sensor noise and the DAQ's quantisation; the sensors' lag applies always.
            seed: seed of the noise.
            interpolation: of the commands between rows: "foh" (first-order hold, linear) or
                "zoh" (each held until the next).
        Returns:
            The trial with measurements and true values.
        Raises:
            ValueError: a command is missing, or has no value in the first row; a later empty cell
                keeps the value before it.
        """
        start_model = begun_at(self.model, trial.memory_at_start)
        if start_model != self.model:
            return Plant(start_model, self.tolerance).simulate(trial, noise, seed, interpolation)
        motor, regulator = sensors.voltages(self.model, trial)
        states, zero = self.run(trial.time, motor, regulator, interpolation)
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
            memory_at_start=trial.memory_at_start,
        )

    def lagged(self, states: np.ndarray, truth: Mapping[str, np.ndarray]) -> np.ndarray:
        """Sensor outputs before noise, (rows, signals): the lag's state, or the mounted value."""

        def memory(effect: Effect) -> np.ndarray:
            (name,) = effect.memory_names
            return states[:, self.states.index(name)]

        def mounted(name: str) -> np.ndarray:
            known = self.model, self.parameters, name, truth[name], memory
            return truth[name] + sensors.mount_error(*known)

        columns = [
            states[:, at] if at >= 0 else mounted(name)
            for at, name in zip(self.sensor_columns, self.outputs, strict=True)
        ]
        return np.stack(columns, axis=1)

    def provenance(self, noise: bool, seed: int | None) -> dict[str, str]:
        """Return the data that reproduce a simulation: model, noise and seed."""
        return {"model": self.model.name, "noise": str(noise), "seed": str(seed)}

    def linearize(
        self,
        pressure: float | None = None,
        contraction: float | None = None,
        direction: str = "relaxing",
    ) -> "control.StateSpace":
        """Linearise about an equilibrium; see `pma_gym.plant.forms.linear.linearize`."""
        # Imported here: python-control takes longer to import than all of this package.
        from pma_gym.plant.forms.linear import linearize

        return linearize(self, pressure, contraction, direction)

    def symbolic(self) -> "dict[str, sympy.Expr]":
        """Return the equations of motion in SymPy; see `pma_gym.plant.forms.symbolic.symbolic`."""
        from pma_gym.plant.forms.symbolic import symbolic

        return symbolic(self)
