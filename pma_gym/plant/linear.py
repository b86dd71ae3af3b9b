"""A plant seen by control theory: linearised as a state space, and written as equations."""

from typing import TYPE_CHECKING, Any

import numpy as np

from pma_gym.plant.lanes import rebind
from pma_gym.plant.plant import OUTPUTS, Condition, Plant
from pma_gym.plant.settle import static_force

if TYPE_CHECKING:
    import control

INPUTS = ("motor_voltage", "regulator_voltage")
DIRECTIONS = {"contracting": 1.0, "relaxing": -1.0}
_STEPS = {"pressure": 100.0, "velocity": 1e-7}
_STEP = 1e-7


def linearize(
    plant: Plant, pressure: float, contraction: float, direction: str = "relaxing"
) -> "control.StateSpace":
    """The plant near rest at a pressure and a contraction, as a linear system.

    Damping has two values at rest, so a direction is named. Memories (dry friction, hysteresis)
    stay where they are: the system slides. Sensor lags are left out.

    Args:
        plant: the plant.
        pressure: gauge pressure (Pa).
        contraction: shortening from the resting length (m), below that at no load.
        direction: `relaxing` (the motor pulls) or `contracting`.
    Returns:
        State space with named states, inputs (V) and outputs: contraction and extension (m),
        rotation (rad), load (N), pressure (Pa), all as deviations from rest.
    Raises:
        ValueError: an unknown direction, or a contraction that no load of 0-10 V holds.
    """
    import control

    if direction not in DIRECTIONS:
        raise ValueError(f"direction must be one of {', '.join(DIRECTIONS)}, got {direction!r}")
    rest, commands = operating_point(plant, pressure, contraction)
    kept = [i for i, name in enumerate(plant.states) if not name.startswith(("memory_", "lag_"))]
    sign = DIRECTIONS[direction]
    a, b = _dynamics(plant, rest, commands, kept, sign)
    return control.ss(
        a, b, _outputs(plant, rest, kept), np.zeros((len(OUTPUTS) + 1, len(INPUTS))),
        states=[plant.states[i] for i in kept], inputs=list(INPUTS),
        outputs=[*OUTPUTS, "extension"], name=plant.model.name,
    )


def operating_point(
    plant: Plant, pressure: float, contraction: float
) -> tuple[Condition, tuple[float, float]]:
    """The condition at rest at a contraction, and the voltages that hold it.

    Raises:
        ValueError: no voltage of 0-10 V holds it; says which contractions can be held.
    """
    regulator = plant.regulator_voltage(pressure)
    motor = _holding_voltage(plant, regulator, contraction)
    return plant.settle(motor, regulator_voltage=regulator), (motor, regulator)


def _holding_voltage(plant: Plant, regulator: float, contraction: float) -> float:
    from scipy.optimize import brentq

    def off(voltage: float) -> float:
        state = plant.settle(voltage, regulator_voltage=regulator).state
        return float(plant.observe(state[None, :], 0.0)["contraction"][0]) - contraction

    shortest, longest = off(0.0), off(_strongest(plant, regulator))
    if not longest <= 0.0 < shortest:
        reach = (longest + contraction) * 1e3, (shortest + contraction) * 1e3
        raise ValueError(
            f"contraction must lie in {reach[0]:.4g} to {reach[1]:.4g} mm (below that at no load) "
            f"at this pressure, got {contraction * 1e3:.4g} mm"
        )
    return float(brentq(off, 0.0, _strongest(plant, regulator), xtol=1e-12))


def _strongest(plant: Plant, regulator: float) -> float:
    """Highest motor voltage whose load the muscle balances within its stroke."""
    if plant.model.plant == "cascade":
        return 10.0
    state = plant.settle(0.0, regulator_voltage=regulator).state
    most = static_force(plant, state)(-plant.model.parameters["limits"].stretch)
    drive = plant.model.parameters["drive"]
    return min(10.0, (most - drive.offset) / drive.gain)


def _dynamics(plant: Plant, rest: Condition, commands: tuple[float, float], kept: list[int],
              sign: float) -> tuple[np.ndarray, np.ndarray]:
    """A and B by central differences; the velocity is moved to one side of its kink."""
    base = rest.state.copy()
    moving = {"velocity": 1e-6 * sign} if "velocity" in plant.states else {"servo": -1e-9 * sign}
    for name, value in moving.items():
        base[plant.states.index(name)] += value

    def rate(state: np.ndarray, motor: float, regulator: float) -> np.ndarray:
        return plant.derivative(state, motor, regulator, rest.zero_contraction)[kept]

    a = np.empty((len(kept), len(kept)))
    for column, at in enumerate(kept):
        step = _STEPS.get(plant.states[at], _STEP)
        step = 1e-10 if plant.model.plant == "cascade" and "pressure" not in plant.states[at] else step
        up, down = base.copy(), base.copy()
        up[at] += step
        down[at] -= step
        a[:, column] = (rate(up, *commands) - rate(down, *commands)) / (2.0 * step)
    b = np.empty((len(kept), len(INPUTS)))
    for column in range(len(INPUTS)):
        step = np.zeros(len(INPUTS))
        step[column] = 1e-4
        high, low = np.add(commands, step), np.subtract(commands, step)
        b[:, column] = (rate(base, *high) - rate(base, *low)) / 2e-4
    return a, b


def _outputs(plant: Plant, rest: Condition, kept: list[int]) -> np.ndarray:
    rows = []
    for at in kept:
        step = _STEPS.get(plant.states[at], _STEP)
        pair = np.stack([rest.state, rest.state])
        pair[:, at] += (step, -step)
        seen = plant.observe(pair, rest.zero_contraction)
        rows.append([(seen[n][0] - seen[n][1]) / (2.0 * step) for n in (*OUTPUTS, "extension")])
    return np.array(rows).T


def symbolic(plant: Plant) -> dict[str, Any]:
    """The plant's equations of motion, from the text that is simulated.

    Needs SymPy (`pip install "pma-gym[symbolic]"`).

    Args:
        plant: the plant.
    Returns:
        SymPy expression of every state's rate, by the state's name. Symbols are the states, the
        commands, zero_contraction, and parameters as effect.name (SI).
    """
    import sympy

    def where(condition: Any, yes: Any, no: Any) -> Any:
        return sympy.Piecewise((yes, condition), (no, True))

    rate = rebind(plant.plain.rate, {"where": where, "exponential": sympy.exp})
    symbols = {name: sympy.Symbol(name, real=True) for name in plant.states}
    inputs = [sympy.Symbol(name, real=True) for name in (*INPUTS, "zero_contraction")]
    parameters = [_symbols(name, values) for name, values in plant.model.parameters.items()]
    parts = iter(rate(*symbols.values(), *inputs, *parameters))
    out = {}
    for name, symbol in symbols.items():
        source = next(parts)
        out[name] = source - next(parts) * symbol if name in plant.decaying else source
    return out


def _symbols(effect: str, values: Any) -> Any:
    import sympy

    def one(path: str, value: Any) -> Any:
        if isinstance(value, tuple):
            return tuple(sympy.Symbol(f"{path}[{i}]", real=True) for i in range(len(value)))
        return sympy.Symbol(path, real=True)

    return type(values)(*(one(f"{effect}.{n}", getattr(values, n)) for n in values._fields))
