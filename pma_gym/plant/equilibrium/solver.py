"""Solve for equilibria: the states in which plants stand still at constant commands."""

import numpy as np

from pma_gym.plant.compiled_model import CompiledModel
from pma_gym.plant.condition import Condition, check_commands
from pma_gym.plant.equilibrium.force_balance import balances
from pma_gym.plant.equilibrium.problem import EquilibriumProblem, effect_parameters, put_memories
from pma_gym.plant.model import Model


def equilibrium_at(
    plant: CompiledModel, motor_voltage: float, regulator_voltage: float
) -> Condition:
    """The plant's equilibrium at constant commands.

    Args:
        plant: the plant.
        motor_voltage: motor command (V).
        regulator_voltage: regulator command (V).
    Returns:
        Where it stands: memories as the model says that trials begin, a load that has long arrived,
        and the contraction x0 (m) that the muscle would have with no load at this pressure.
    Raises:
        ValueError: a voltage out of 0-10 V, or no contraction within twice the limits balances
            the load.
    """
    check_commands(plant.model, motor_voltage, regulator_voltage)
    commands = np.array([motor_voltage], float), np.array([regulator_voltage], float)
    problem = _solve(plant, *commands, None)
    if problem.unbalanced:
        raise ValueError(f"model {plant.model.name}: {problem.unbalanced}")
    zero = float(problem.zero[0])
    return Condition(problem.state[0], zero, commands=(motor_voltage, regulator_voltage))


def equilibria_at(
    plant: CompiledModel,
    motor_voltages: np.ndarray,
    regulator_voltages: np.ndarray,
    vectors: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Equilibria of many plants of one structure, as `equilibrium_at`; none depends on another.

    Args:
        plant: one of them.
        motor_voltages: motor commands (V), shape (n,).
        regulator_voltages: regulator commands (V), shape (n,).
        vectors: parameters of each (`program.vector`), shape (n, numbers); the plant's own if not
            given.
    Returns:
        State vectors, shape (n, states), and contractions x0 (m), shape (n,); NaN where no
        contraction balances the load.
    """
    problem = _solve(plant, motor_voltages, regulator_voltages, vectors)
    return problem.state, problem.zero


def hangs_by_itself(model: Model) -> bool:
    """Whether a model at rest with a slack cable is known by its muscle's balance alone.

    It is where sensors rest at the truth, and the regulator's command has no memory.
    """
    effects = model.effects.values()
    sensed = any(effect.port.startswith("sensor:") and effect.law for effect in effects)
    delayed = any(effect.port == "regulator_delay" for effect in effects)
    return model.rig.balances_loads and not sensed and not delayed


class NoLoadEquilibria:
    """Stations at rest with 0 V on the motor, many at once.

    Args:
        plant: a plant of their structure.

    Attributes:
        plant: the same.
    """

    def __init__(self, plant: CompiledModel) -> None:
        self.plant = plant
        self._common = self._ends(None) if hangs_by_itself(plant.model) else None
        self._contractions, self._pressures = (
            [i for i, name in enumerate(plant.states) if name in names]
            for names in (("contraction", "lag_lvdt"), ("pressure", "lag_pressure_transducer"))
        )

    def _ends(self, vectors: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, bool]:
        """Contractions between which a balance counts (m), and whether no drive pulls at 0 V."""
        plant = self.plant
        limits, drive = (
            effect_parameters(plant, vectors, effect) for effect in ("limits", "drive")
        )
        low, high = -2.0 * limits["stretch"] + 1e-6, 2.0 * limits["contraction"] - 1e-6
        return low, high, bool((drive["offset"] <= 0.0).all())

    def __call__(
        self, pressures: np.ndarray, vectors: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Their states.

        Args:
            pressures: gauge pressures (Pa), shape (n,).
            vectors: parameters of each, shape (n, numbers); the plant's own if not given.
        Returns:
            State vectors, shape (n, states), and contractions x0 (m), shape (n,); None where the
            cable does not hang slack at 0 V, a muscle finds no balance, sensors do not rest at the
            truth, or the regulator's command has a memory: `Plant.settle` knows those.
        """
        if self._common is None:
            return None
        low, high, slack = self._common if vectors is None else self._ends(vectors)
        zero = balances(self.plant, pressures, np.zeros(len(pressures)), vectors)
        if not slack or not ((zero > low) & (zero < high)).all():
            return None
        states = np.zeros((len(pressures), len(self.plant.states)))
        for i in self._contractions:
            states[:, i] = zero
        for i in self._pressures:
            states[:, i] = pressures
        put_memories(self.plant, vectors, states)
        return states, zero


def _solve(
    plant: CompiledModel,
    motor_voltages: np.ndarray,
    regulator_voltages: np.ndarray,
    vectors: np.ndarray | None,
) -> EquilibriumProblem:
    problem = EquilibriumProblem(plant, motor_voltages, regulator_voltages, vectors)
    problem.relax_memory("regulator_delay")
    if plant.model.rig.has_muscle:
        _settle_pressure(problem)
    for port in ("drive_delay", "drive_lag"):
        problem.relax_memory(port)
    plant.model.rig.solve_equilibrium(problem)
    for name in plant.states:
        if name.startswith("lag_"):
            problem.relax(name)
    for lag, rate in plant.model.rig.moving_lags.items():
        if lag in plant.states:
            problem.follow(lag, problem[rate])
    return problem


_STEADY = 1.0
"""Rate (Pa/s) under which a pressure has settled."""


def _settle_pressure(problem: EquilibriumProblem) -> None:
    """Pressures at which the regulators rest.

    A limit on their rate has them searched for where they are asked to be, and a deadband, in which
    they rest anywhere, has them begin there.
    """
    if not {"regulator_rate_limit", "regulator_deadband"} & problem.plant.effects.keys():
        problem.relax("pressure")
        return
    with np.errstate(divide="ignore", invalid="ignore"):
        problem.relax("pressure")
        pressure, line = problem["pressure"].copy(), problem.parameters("regulator_line")
        settled = np.abs(problem.rate("pressure")) <= _STEADY
        asked = np.maximum(line["gain"] * problem.inputs[:, 1] + line["offset"], 0.0)
        problem.relax("pressure", about=asked)
    pressure = np.where(settled, pressure, problem["pressure"])
    if "regulator_deadband" in problem.plant.effects:
        width = problem.parameters("regulator_deadband")["width"]
        pressure = np.where(width > 0.0, asked, pressure)
    problem["pressure"] = pressure
