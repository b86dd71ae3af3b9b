"""Linearisation of a plant about an equilibrium, as a state space of python-control."""

from typing import TYPE_CHECKING

import numpy as np

from pma_gym.data.signals import is_pressure
from pma_gym.effects.effect import ANTAGONIST
from pma_gym.plant.compiled_model import CompiledModel
from pma_gym.plant.equilibrium.force_balance import static_force
from pma_gym.plant.equilibrium.solver import equilibria_at, equilibrium_at
from pma_gym.plant.sensors import active_commands
from pma_gym.plant.statics import Condition
from pma_gym.units import SI_FACTORS

if TYPE_CHECKING:
    import control

INPUTS = ("motor_voltage", "regulator_voltage")
DIRECTIONS = {"contracting": 1.0, "relaxing": -1.0}
"""Sign of the velocity by direction of motion."""

_STEP, _PRESSURE_STEP, _VOLTAGE_STEP = 1e-7, 100.0, 1e-4
"""Steps of the central differences: m, rad or their rates; Pa; V."""

_FOLLOWING = ("drive_delay", "drive_lag", "regulator_delay", "regulator_lag", "coupling")
"""Ports whose effects' states are part of the linear system."""

_AWAY = 1e-6
"""Offset from rest (m/s, m) at which differences begin, beyond the kink of the damping."""


def linearize(
    plant: CompiledModel,
    pressure: float | None = None,
    contraction: float | None = None,
    direction: str = "relaxing",
) -> "control.StateSpace":
    """Linearise the plant about the equilibrium at a pressure and a contraction.

    Damping has two values at rest, so the caller chooses a direction; a regulator with two rates
    gets their mean. The states of dry friction, hysteresis and creep are constant: the system
    slides. Sensor lags are not included.

    Args:
        plant: the plant.
        pressure: gauge pressure (Pa); None for a command of 0: a rig without a regulator, or shut
            valves at the pressure with which the model begins.
        contraction: shortening from the resting length (m), less than without load; of a joint
            with two muscles its angle (rad), which the second one holds. None for the equilibrium
            without a command to motor or second muscle.
        direction: `relaxing` (the motor pulls) or `contracting`.
    Returns:
        State space with named states, inputs (V) and outputs: contraction and extension (m),
        rotation (rad), load (N), pressure (Pa), all as deviations from rest.
    Raises:
        ValueError: an unknown direction, or a contraction that no motor voltage of 0-10 V holds.
    """
    rest, commands = operating_point(plant, pressure, contraction)
    return linearize_at(plant, rest, commands, direction)


def linearize_at(
    plant: CompiledModel,
    rest: Condition,
    commands: tuple[float, float],
    direction: str = "relaxing",
) -> "control.StateSpace":
    """Linearise the plant about a known condition at rest, as `linearize`.

    Args:
        plant: the plant.
        rest: condition at rest.
        commands: motor and regulator voltage at it (V).
        direction: `relaxing` (the motor pulls) or `contracting`.
    """
    import control

    if direction not in DIRECTIONS:
        raise ValueError(f"direction must be one of {', '.join(DIRECTIONS)}, got {direction!r}")
    base = Condition(rest.state.copy(), rest.zero_contraction)
    speed = next((name for name in ("velocity", "spin") if name in plant.states), "")
    if speed:
        base.state[plant.states.index(speed)] += _AWAY * DIRECTIONS[direction]
    else:
        # The cascade's muscle shortens where its motor, or its own contraction, stands behind it.
        for name in ("servo", "free_contraction"):
            base.state[plant.states.index(name)] -= _AWAY * DIRECTIONS[direction]
    kept = [
        i
        for i, name in enumerate(plant.states)
        if name in following(plant) or not name.startswith(("memory_", "lag_"))
    ]
    seen = _seen(plant)
    return control.StateSpace(
        _by_state(plant, base, commands, kept),
        _by_input(plant, base, commands)[kept],
        _outputs(plant, rest, kept),
        np.zeros((len(seen), len(INPUTS))),
        states=[plant.states[i] for i in kept],
        inputs=[
            command.name if command else slot
            for command, slot in zip(active_commands(plant.model), INPUTS, strict=True)
        ],
        outputs=list(seen),
        name=plant.model.name,
    )


def following(plant: CompiledModel) -> tuple[str, ...]:
    """States that follow a command within milliseconds and are part of the linear system."""
    return tuple(
        name
        for effect in plant.effects.values()
        if effect.port.removeprefix(ANTAGONIST) in _FOLLOWING
        for name in effect.memory_names
    )


def _seen(plant: CompiledModel) -> tuple[str, ...]:
    """Names of a plant's outputs, and of what counts from a trial's start."""
    return (*plant.outputs, *(each.reading for each in plant.signals if each.reading))


def operating_point(
    plant: CompiledModel, pressure: float | None, contraction: float | None
) -> tuple[Condition, tuple[float, float]]:
    """Find the condition at rest at a contraction, and the voltages that hold it.

    Raises:
        ValueError: no voltage of 0-10 V holds it; with the range of possible contractions.
    """
    regulator = 0.0 if pressure is None else plant.regulator_voltage(pressure)
    motor = 0.0 if contraction is None else _holding_voltage(plant, regulator, contraction)
    return equilibrium_at(plant, motor, regulator), (motor, regulator)


def _holding_voltage(plant: CompiledModel, regulator: float, contraction: float) -> float:
    from scipy.optimize import root_scalar

    position = next(signal for signal in plant.signals if signal.is_position)
    factor = SI_FACTORS[position.unit]

    def off(voltage: float) -> float:
        state = equilibrium_at(plant, voltage, regulator).state
        return float(plant.observe(state[None, :], 0.0)[position.name][0]) - contraction

    least, strongest = 0.0, _strongest(plant, regulator)
    if plant.model.rig.commands:
        # Beyond some voltages the arm of a muscle joint leaves its range.
        volts = np.linspace(least, strongest, 101)
        angles = equilibria_at(plant, volts, np.full(101, regulator))[1]
        held = volts[np.isfinite(angles)]
        least, strongest = (held[0], held[-1]) if held.size else (least, strongest)
    slack, furthest = off(least), off(strongest)
    if not furthest <= 0.0 < slack:
        raise ValueError(
            f"{position.name} must lie in {(furthest + contraction) / factor:.4g} to "
            f"{(slack + contraction) / factor:.4g} {position.unit} (below that at no load), what a "
            f"motor voltage of {least:g} to {strongest:.4g} V holds at this pressure; got "
            f"{contraction / factor:.4g} {position.unit}"
        )
    return float(root_scalar(off, method="brentq", bracket=(least, strongest), xtol=1e-12).root)


def _strongest(plant: CompiledModel, regulator: float) -> float:
    """Highest motor voltage whose load the muscle balances within its stroke."""
    if not plant.model.rig.balances_loads:
        return 10.0
    state = equilibrium_at(plant, 0.0, regulator).state
    most = static_force(plant, state)(-plant.model.parameters["limits"].stretch)
    drive = plant.model.parameters["drive"]
    return min(10.0, (most - drive.offset) / drive.gain)


def _by_state(
    plant: CompiledModel, base: Condition, commands: tuple[float, float], kept: list[int]
) -> np.ndarray:
    columns = []
    for high, low, step in _pairs(plant, base.state, kept):
        up = plant.derivative(high, *commands, base.zero_contraction)
        down = plant.derivative(low, *commands, base.zero_contraction)
        columns.append((up - down)[kept] / (2.0 * step))
    return np.stack(columns, axis=1)


def _by_input(plant: CompiledModel, base: Condition, commands: tuple[float, float]) -> np.ndarray:
    columns = []
    for step in _VOLTAGE_STEP * np.eye(len(INPUTS)):
        (motor, regulator), zero = commands, base.zero_contraction
        up = plant.derivative(base.state, motor + step[0], regulator + step[1], zero)
        down = plant.derivative(base.state, motor - step[0], regulator - step[1], zero)
        columns.append((up - down) / (2.0 * _VOLTAGE_STEP))
    return np.stack(columns, axis=1)


def _outputs(plant: CompiledModel, rest: Condition, kept: list[int]) -> np.ndarray:
    columns = []
    for high, low, step in _pairs(plant, rest.state, kept):
        seen = plant.observe(np.stack([high, low]), rest.zero_contraction)
        columns.append([(seen[name][0] - seen[name][1]) / (2.0 * step) for name in _seen(plant)])
    return np.transpose(columns)


def _pairs(
    plant: CompiledModel, state: np.ndarray, kept: list[int]
) -> list[tuple[np.ndarray, np.ndarray, float]]:
    """The state moved up and down along each kept state, and the step."""
    pairs = []
    for at in kept:
        step = _PRESSURE_STEP if is_pressure(plant.states[at]) else _STEP
        move = np.zeros_like(state)
        move[at] = step
        pairs.append((state + move, state - move, step))
    return pairs
