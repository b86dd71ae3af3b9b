"""The nominal plant simulated along a motion, and linearised on the way.

The feed-forward's voltages drive the nominal plant, held to what its actuator can give: corners,
slack, hysteresis and limits are in the motion that results, and what the feed-forward misses is its
error. Deviations x of the states from that motion follow, in every control period,

    x' = A x + b_m v_m + b_r v_r

v_m and v_r being deviations of the voltages of motor and regulator. A and b are the derivatives of
the plant's own equations in the middle of the period. Memories (hysteresis, dry friction, creep)
stay as they are on the way: the muscle goes on sliding.
"""

from typing import NamedTuple

import numpy as np

from controllers.models.voltage import VOLTAGE_LIMIT
from pma_gym.data.signals import SIGNALS, is_pressure
from pma_gym.engine.nominal_rig import motor_at_rest
from pma_gym.envs import StationInfo
from pma_gym.plant.forms.linear import following
from pma_gym.plant.plant import Plant
from pma_gym.plant.rigs import RIGS

STEP, PRESSURE_STEP, VOLTAGE_STEP = 1e-7, 100.0, 1e-4
"""Steps of the central differences: m, rad or 1/s of them; Pa; V."""

LOOSE_N = 3.0
"""Tension below which the cable is taken to hang loose (N): five standard deviations of what the
load cell says."""

JUST_PULLING = 1e-3
"""How far above the voltage at which the drive begins to pull it is linearised at least (V)."""


class LinearMotion(NamedTuple):
    """A nominal motion and the plant near it. A period is a row of the arrays.

    Attributes:
        volts: voltage of the actuator in force (V), shape (steps,).
        idle: voltage at which a nominal drive begins to pull; 0 of a regulator (V).
        slackened: whether the nominal cable hangs loose in a period after it was taut, so that the
            drive idles, shape (steps,).
        error: nominal position less the reference at the periods' ends (m or rad), shape
            (steps + 1,); 0 after the trial's end.
        readings: what the sensors would say (extension, rotation, load, pressure; SI), shape
            (steps + 1, 4).
        a: A, shape (steps, n, n).
        motor: b_m, shape (steps, n).
        regulator: b_r, shape (steps, n).
        force: x' by a force at the slide (1/N of it), shape (n,); zeros without a slide.
        damped: number of the state that the muscle damps, or None if it is not one of them.
        speed: nominal value of that state in the middle of a period, shape (steps,).
        states: nominal values of the states in x, shape (steps + 1, n).
        position: the task's position by x, shape (n,).
        names: of the states in x.
        sensors: extension, rotation and pressure by x, as sensors say them, shape (3, n).
        last: number of the last period's end within the trial.
    """

    volts: np.ndarray
    idle: float
    slackened: np.ndarray
    error: np.ndarray
    readings: np.ndarray
    a: np.ndarray
    motor: np.ndarray
    regulator: np.ndarray
    force: np.ndarray
    damped: int | None
    speed: np.ndarray
    states: np.ndarray
    position: np.ndarray
    names: tuple[str, ...]
    sensors: np.ndarray
    last: int


def linear_motion(
    needed: np.ndarray, target: np.ndarray, station: StationInfo, beyond: int
) -> LinearMotion:
    """The nominal motion under the feed-forward's voltages, and the plant near it.

    Args:
        needed: voltage that should be in force in every period of the trial (V), shape (trial,).
        target: reference at the periods' ends (m or rad), shape (trial + 1,).
        station: nominal model, task, pressure, control period.
        beyond: periods after the trial's end for which the last voltage is held.
    """
    plant, task = Plant(station.model), station.task
    moved_by_motor = task.actuator == "motor"
    idle = _idle_voltage(station) if moved_by_motor else 0.0
    volts = np.clip(np.append(needed, np.full(beyond, needed[-1])), idle, VOLTAGE_LIMIT)
    rest_voltages = motor_at_rest(station.model, task), plant.regulator_voltage(station.pressure)
    motor, regulator = (np.full(len(volts), voltage) for voltage in rest_voltages)
    commands = (volts, regulator) if moved_by_motor else (motor, volts)
    rest = plant.settle(rest_voltages[0], regulator_voltage=rest_voltages[1])
    times = station.period * np.arange(len(volts) + 1)
    states, zero = plant.run(
        times, *(np.append(one, one[-1]) for one in commands), interpolation="zoh", condition=rest
    )
    truth = plant.observe(states, zero)
    start = truth["contraction"][0]
    position = truth[task.schedule.quantity] - (start if task.load else 0.0)
    error = np.append(position[: len(target)] - target, np.zeros(beyond))
    readings = plant.lagged(states, truth)
    readings[:, 0] = start - readings[:, 0]
    readings[:, 1] -= readings[0, 1]
    pulling = np.maximum(commands[0], idle + JUST_PULLING) if moved_by_motor else motor
    inputs = np.stack([pulling, commands[1], np.full(len(volts), zero)], axis=1)
    kept = _kept(plant)
    middle = 0.5 * (states[:-1] + states[1:])
    a, b = _derivatives(plant, middle, inputs, kept)
    names = [plant.states[i] for i in kept]
    damped = names.index("velocity") if "velocity" in names else None
    force = np.zeros(len(kept))
    if damped is not None:
        force[damped] = 1.0 / station.model.parameters["slide"].mass
    seen = _outputs(plant, states[0], zero, kept)
    return LinearMotion(
        volts,
        idle,
        _slackened(readings[:-1, 2]) & moved_by_motor,
        error,
        readings,
        a,
        b[:, :, 0],
        b[:, :, 1],
        force,
        damped,
        middle[:, kept[damped]] if damped is not None else np.zeros(len(volts)),
        states[:, kept],
        seen[task.schedule.quantity],
        tuple(names),
        _sensors(plant, kept, seen),
        len(needed),
    )


def _idle_voltage(station: StationInfo) -> float:
    """Motor voltage (V) at which the nominal drive begins to pull; 0 without a drive."""
    drive = station.model.parameters.get("drive")
    return max(0.0, -drive.offset / drive.gain) if drive else 0.0


def _slackened(tension: np.ndarray) -> np.ndarray:
    """Where a cable hangs loose after it was taut, by its tension (N)."""
    loose = tension < LOOSE_N
    return loose & np.logical_or.accumulate(~loose)


def _kept(plant: Plant) -> list[int]:
    """Numbers of the states that deviate: not memories, nor the load cell's lag."""
    return [
        i
        for i, name in enumerate(plant.states)
        if (not name.startswith("memory_") or name in following(plant)) and name != "lag_load_cell"
    ]


def _derivatives(
    plant: Plant, states: np.ndarray, inputs: np.ndarray, kept: list[int]
) -> tuple[np.ndarray, np.ndarray]:
    """A and b of every row: derivatives of the rates by kept states and by both voltages."""
    by_state, by_voltage = [], []
    for at in kept:
        move = np.zeros(len(plant.states))
        move[at] = _step(plant.states[at])
        change = _rates(plant, states + move, inputs) - _rates(plant, states - move, inputs)
        by_state.append(change[:, kept] / (2.0 * move[at]))
    for move in VOLTAGE_STEP * np.eye(2, 3):
        change = _rates(plant, states, inputs + move) - _rates(plant, states, inputs - move)
        by_voltage.append(change[:, kept] / (2.0 * VOLTAGE_STEP))
    return np.stack(by_state, axis=2), np.stack(by_voltage, axis=2)


def _step(name: str) -> float:
    return PRESSURE_STEP if is_pressure(name) else STEP


def _rates(plant: Plant, states: np.ndarray, inputs: np.ndarray) -> np.ndarray:
    """Rates of many states, each with its motor and regulator voltage and x0."""
    out = np.empty_like(states)
    addresses = (array.ctypes.data for array in (states, inputs, plant.vector))
    plant.program.derivative(len(out), *addresses, 0, out.ctypes.data)
    return out


def _outputs(
    plant: Plant, state: np.ndarray, zero: float, kept: list[int]
) -> dict[str, np.ndarray]:
    """What each output gains by each kept state; outputs but the load are linear in them."""
    moves = np.zeros((len(kept), len(plant.states)))
    steps = np.array([_step(plant.states[at]) for at in kept])
    moves[np.arange(len(kept)), kept] = steps
    high, low = (plant.observe(state + way * moves, zero) for way in (1.0, -1.0))
    return {name: (high[name] - low[name]) / (2.0 * steps) for name in high}


def _sensors(plant: Plant, kept: list[int], seen: dict[str, np.ndarray]) -> np.ndarray:
    """Extension, rotation and pressure as sensors say them, by the kept states."""
    rows = []
    for name in ("contraction", "rotation", "pressure"):
        at = plant.sensor_columns[RIGS["station"].outputs.index(name)]
        row = seen[name] if at < 0 else np.eye(len(kept))[kept.index(at)]
        rows.append(-row if SIGNALS[name].shortens else row)
    return np.array(rows)
