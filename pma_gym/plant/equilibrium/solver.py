"""Solve for the equilibria of plants at constant commands."""

import numpy as np

from pma_gym.data.signals import SIGNALS
from pma_gym.effects.effect import Effect
from pma_gym.effects.ports import SENSOR_DELAY, measured_output
from pma_gym.plant.compiled_model import CompiledModel
from pma_gym.plant.equilibrium.force_balance import balances
from pma_gym.plant.equilibrium.problem import EquilibriumProblem, effect_parameters, put_memories
from pma_gym.plant.model import Model
from pma_gym.plant.rigs.rig import Rig
from pma_gym.plant.statics import Condition, check_commands


def start_sensors(problem: EquilibriumProblem, rig: Rig) -> None:
    """Set the states of delays and lags of sensors; the states of the rig must have been set."""
    late = [
        effect for effect in problem.plant.effects.values() if effect.port.startswith(SENSOR_DELAY)
    ]
    late = [effect for effect in late if effect.memory_names[0] in problem.names]
    for effect in late:
        problem.relax_memory(effect.port)
        if rig.is_free:
            _follow_motion(problem, effect, rig)
    for name in problem.names:
        if name.startswith("lag_"):
            problem.relax(name)
    for lag, rate in rig.moving_lags.items():
        if lag in problem.names:
            problem.follow(lag, problem[rate])


def _follow_motion(problem: EquilibriumProblem, effect: Effect, rig: Rig) -> None:
    """Put a delay where it is if the output has moved with constant acceleration before.

    The ladder is m' = L m + b u. For u' = v, v' = a it is at m = A u + B v + C a with L A = -b,
    L B = A and L C = B. At rest its even states are the output and the odd ones 0: that is A.
    """
    names = effect.memory_names
    _, speed = rig.start_paths
    moving = SIGNALS[measured_output(effect.port)].is_position
    rates = (problem[speed], problem.rate(speed)) if moving else (problem.rate(speed),)
    share = problem.parameters(effect.name)["share"]
    shape = np.outer(share * np.ones(len(problem.state)), np.arange(len(names)) % 2)
    slopes = problem.slopes(names)
    state = np.stack([problem[name] for name in names], axis=1)
    for rate in rates:
        shape = np.linalg.solve(slopes, shape[..., None])[..., 0]
        state += shape * rate[:, None]
    for i, name in enumerate(names):
        problem[name] = state[:, i]


def equilibrium_at(
    plant: CompiledModel, motor_voltage: float, regulator_voltage: float
) -> Condition:
    """Solve for the plant's equilibrium at constant commands.

    Args:
        plant: the plant.
        motor_voltage: motor command (V).
        regulator_voltage: regulator command (V).
    Returns:
        The condition at rest: initial states of effects as in the model, all lags settled, and x0
        the contraction (m) of the muscle without load at this pressure.
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
    """Solve for the equilibria of many plants of one structure, each independent of the others.

    Args:
        plant: one of them.
        motor_voltages: motor commands (V), shape (n,).
        regulator_voltages: regulator commands (V), shape (n,).
        vectors: parameters of each plant (`program.vector`), shape (n, numbers); those of `plant`
            if not given.
    Returns:
        State vectors, shape (n, states), and contractions x0 (m), shape (n,); NaN where no
        contraction balances the load.
    """
    problem = _solve(plant, motor_voltages, regulator_voltages, vectors)
    return problem.state, problem.zero


def hangs_by_itself(model: Model) -> bool:
    """Whether the muscle's balance determines the equilibrium with a slack cable.

    This requires sensors whose steady value is the true value, and a regulator command without
    dynamics.
    """
    effects = model.effects.values()
    sensed = any(measured_output(effect.port) and effect.law for effect in effects)
    delayed = any(effect.port == "regulator_delay" for effect in effects)
    return model.rig.balances_loads and not sensed and not delayed


class NoLoadEquilibria:
    """Solve for the equilibria of many stations with 0 V at the motor.

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
        """Solve for the states at rest.

        Args:
            pressures: gauge pressures (Pa), shape (n,).
            vectors: parameters of each plant, shape (n, numbers); those of `plant` if not given.
        Returns:
            State vectors, shape (n, states), and contractions x0 (m), shape (n,). None if the cable
            is taut at 0 V, a muscle has no balance, a sensor's steady value is not the true value,
            or the regulator's command has dynamics; use `Plant.settle` then.
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
    start_sensors(problem, plant.model.rig)
    return problem


_STEADY = 1.0
"""Rate (Pa/s) below which a pressure counts as settled."""


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
