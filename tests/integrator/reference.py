"""Trials to measure an integrator on, and their solution to eleven digits by scipy.

The reference is DOP853 at rtol 1e-11. Its spans end at every command, wherever the slide turns and
wherever the cable tightens: the right-hand side has a kink there, and dry friction remembers the
way travelled since.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from pma_gym.plant.plant import Plant
from pma_gym.plant.simulation import Run, simulate_all
from pma_gym.plant.statics import Condition

CONTROL_PERIOD = 0.01
"""Time from one command to the next (s)."""

JITTER, GENTLE_JITTER = 0.1, 4e-3
"""Standard deviation of the motor voltage around its ramp (V): that of a derivative on a noisy
sensor, and that of a calm controller."""

RAMP = 2.2
"""Slope of the motor voltage (V/s), which moves the slide at a constant speed."""

Rate = Callable[[float, NDArray[np.float64]], NDArray[np.float64]]


@dataclass(frozen=True)
class Commands:
    """A plant's commands, held from each time to the next.

    Attributes:
        time: times (s), shape (n,).
        motor: motor voltage (V), shape (n,).
        regulator: regulator voltage (V), shape (n,).
    """

    time: NDArray[np.float64]
    motor: NDArray[np.float64]
    regulator: NDArray[np.float64]


def demanding_commands(plant: Plant, pressure: float, seed: int = 0, steps: int = 100) -> Commands:
    """A ramp of the motor with jitter, a drop by 30 %, a pressure step of 0.3 V; 100 Hz."""
    generator = np.random.default_rng(seed)
    when = _times(steps)
    motor = np.clip(0.5 + RAMP * when + JITTER * generator.standard_normal(steps + 1), 0.0, 10.0)
    motor[6 * steps // 10 : 3 * steps // 4] *= 0.7
    regulator = np.full(steps + 1, plant.regulator_voltage(pressure))
    regulator[steps // 2 :] += 0.3
    return Commands(when, motor, regulator)


def random_commands(plant: Plant, pressure: float, seed: int = 0, steps: int = 100) -> Commands:
    """A policy that has learnt nothing: 0-10 V on the motor, drawn anew every 10 ms."""
    motor = np.random.default_rng(seed).uniform(0.0, 10.0, steps + 1)
    return Commands(_times(steps), motor, np.full(steps + 1, plant.regulator_voltage(pressure)))


def gentle_commands(plant: Plant, pressure: float, seed: int = 0, steps: int = 100) -> Commands:
    """An isokinetic ramp under a calm controller: 4 mV of jitter, constant pressure."""
    generator = np.random.default_rng(seed)
    when = _times(steps)
    motor = np.clip(0.5 + RAMP * when + GENTLE_JITTER * generator.standard_normal(steps + 1), 0, 10)
    return Commands(when, motor, np.full(steps + 1, plant.regulator_voltage(pressure)))


def _times(steps: int) -> NDArray[np.float64]:
    return CONTROL_PERIOD * np.arange(steps + 1, dtype=np.float64)


TRIALS: dict[str, Callable[[Plant, float], Commands]] = {
    "demanding": demanding_commands,
    "random": random_commands,
    "gentle": gentle_commands,
}
"""Trials by name; `demanding` is what the limits hold for."""


def reference(plant: Plant, start: Condition, commands: Commands) -> NDArray[np.float64]:
    """States at every command, shape (n, states), by DOP853 at rtol 1e-11."""
    states = [start.state]
    spans = zip(np.diff(commands.time), commands.motor, commands.regulator, strict=False)
    for duration, motor, regulator in spans:

        def rate(
            _: float, state: NDArray, motor: float = motor, regulator: float = regulator
        ) -> NDArray:
            return plant.derivative(state, motor, regulator, start.zero_contraction)

        events = switches(plant, start.zero_contraction)
        states.append(integrated(rate, states[-1], float(duration), events))
    return np.array(states)


def switches(plant: Plant, zero: float) -> list[NDArray[np.float64]]:
    """Where spans end: linear functions of the state, by their factors and a constant at the end.

    They are the slide's velocity, and the stretch of the cable beyond its slack.
    """
    if not plant.model.rig.balances_loads:
        return []
    part, at = plant.model.parameters, plant.states.index
    turning, tightness = np.zeros((2, len(plant.states) + 1))
    turning[at("velocity")] = 1.0
    tightness[[at("contraction"), at("angle"), -1]] = (
        1.0,
        part["rotor"].radius,
        -zero - part["cable"].slack,
    )
    return [turning, tightness]


def integrated(
    rate: Rate, state: NDArray, duration: float, events: list[NDArray], rtol: float = 1e-11
) -> NDArray[np.float64]:
    """The state after a while of constant commands.

    Args:
        rate: rate of the state.
        state: where it begins.
        duration: how long (s).
        events: linear functions of the state at whose zeros the rate has a kink, see `switches`.
        rtol: relative tolerance.
    """
    begin, pause = 0.0, 1e-7
    while begin < duration:
        detectors = [_event(factors, rate, state) for factors in events]
        span = solve_ivp(
            rate, (begin, duration), state, "DOP853", rtol=rtol, atol=1e-13, events=detectors
        )
        moved = span.t[-1] > begin + 1e-12
        if not moved:
            # At rest on a switch: on without it for a while, longer each time.
            end = min(begin + pause, duration)
            span = solve_ivp(rate, (begin, end), state, "DOP853", rtol=rtol, atol=1e-13)
        pause = 1e-7 if moved else 4.0 * pause
        begin, state = float(span.t[-1]), span.y[:, -1].copy()
        for factors, crossings in zip(events, span.t_events if moved else (), strict=False):
            if len(crossings) and np.count_nonzero(factors) == 1:
                # On the switch to the last bit, so that it is not found again at once.
                state[np.flatnonzero(factors)] = 0.0
    return state


def _event(factors: NDArray, rate: Rate, state: NDArray) -> Callable[[float, NDArray], float]:
    """The next zero of a switch on the way that the state is about to take."""

    def value(_: float, state: NDArray) -> float:
        return float(factors[:-1] @ state + factors[-1])

    now, ahead = value(0.0, state), float(factors[:-1] @ rate(0.0, state))
    side = np.sign(now) if abs(now) > 1e-15 else np.sign(ahead)
    value.terminal = True  # pyright: ignore[reportFunctionMemberAccess]
    value.direction = -side  # pyright: ignore[reportFunctionMemberAccess]
    return value


def simulated(plant: Plant, start: Condition, commands: Commands) -> NDArray[np.float64]:
    """The same by the plant's own integrator."""
    when, motor, regulator = commands.time, commands.motor, commands.regulator
    return plant.run(when, motor, regulator, interpolation="zoh", condition=start)[0]


def shares(states: NDArray[np.float64], truth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Largest error of each state as a share of its range, shape (states,).

    A state that does not move in the trial has no range; its error counts against its size.
    """
    size = np.maximum(np.abs(truth).max(axis=0), 1e-300)
    moved = np.ptp(truth, axis=0)
    return np.abs(states - truth).max(axis=0) / np.where(moved > 1e-6 * size, moved, size)


MODELS = ("serres2008", "station", "cascade")
PRESSURES = (200e3, 350e3, 550e3)
STATE_LIMIT, POSITION_LIMIT = 1e-4, 1e-6
"""Largest errors at the default tolerance in the demanding trial, as shares of the range: any
state, and the positions."""

POSITIONS = ("contraction", "angle", "extension", "servo")


def error_ladder(
    model: str, tolerances: Sequence[float]
) -> tuple[list[str], NDArray[np.float64], NDArray[np.float64]]:
    """Errors and price of the demanding trial at several tolerances.

    Args:
        model: a shipped model.
        tolerances: of the integration.
    Returns:
        The states' names; the largest error of each over all pressures, as a share of its range,
        shape (tolerances, states); attempts at internal steps in a control step of 10 ms.
    """
    plants = [Plant(model, tolerance) for tolerance in tolerances]
    worst, attempts = np.zeros((len(plants), len(plants[0].states))), np.zeros(len(plants))
    for pressure in PRESSURES:
        start = plants[0].settle(0.0, pressure)
        commands = demanding_commands(plants[0], pressure)
        truth = reference(plants[0], start, commands)
        for row, plant in enumerate(plants):
            run = Run(
                *(commands.time, commands.motor, commands.regulator),
                *("zoh", plant.table, start.state, start.zero_contraction),
            )
            attempts[row] += simulate_all(plant.program, [run])
            worst[row] = np.maximum(worst[row], shares(run.states, truth))
    attempts /= len(PRESSURES) * (len(commands.time) - 1)
    return plants[0].states, worst, attempts
