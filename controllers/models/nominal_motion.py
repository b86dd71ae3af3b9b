"""The nominal plant along a reference: the voltage it needs, and how it answers near there.

Simulate a trial on the nominal plant beforehand, and improve its voltages.
"""

from functools import cached_property, lru_cache

import numpy as np

from controllers.design.designs import must_give_a_position
from controllers.models.inverse import Inverse, inverse_of
from controllers.models.local_model import LocalModel, Stroke
from controllers.models.operating_range import ModelKey, rest_voltages, sensor_of, stroke_along
from controllers.models.voltage import VOLTAGE_LIMIT
from controllers.registry import Reference
from pma_gym.envs import StationInfo
from pma_gym.plant.plant import Plant

JUMP_SHARE = 0.02
"""Share of the range beyond which a change within a step of the inverse, 2 ms at most, is a jump:
the fastest motion that is meant to be followed goes 0.12 % of its range in that time."""

DRIVEN_SHARE = 0.7
"""Share s of the voltage's way to its limit that is planned with."""

SLOWEST = 0.5
"""Least speed planned, in ranges a second: near the cable's slack hardly anything drives back."""


def jumps(target: np.ndarray, span: float) -> np.ndarray:
    """Indices of nodes after which a reference jumps.

    Args:
        target: the reference at the nodes (m or rad), shape (n,).
        span: range of the task (m or rad).
    """
    return np.flatnonzero(np.abs(np.diff(target)) > JUMP_SHARE * span)


def delayed_start(target: np.ndarray, first: int) -> np.ndarray:
    """The reference, but at rest up to a node: no command is in force before."""
    planned = target.copy()
    planned[: first + 1] = target[0]
    return planned


def without_jumps(
    target: np.ndarray, first: int, step: float, stroke: Stroke, span: float
) -> np.ndarray:
    """The reference with ways in place of its jumps.

    Args:
        target: the reference at the nodes (m or rad), shape (n,).
        first: the first node from which the plant can be moved.
        step: time between nodes (s).
        stroke: how the plant answers along the stroke.
        span: range of the task (m or rad).
    """
    planned = target.copy()
    for at in jumps(target, span).tolist():
        way = _way(float(target[at]), float(target[at + 1]), step, stroke, SLOWEST * span)
        start = max(at + 1 - len(way) // 2, first)
        part = planned[start : start + len(way)]
        part[:] = way[: len(part)]
    return planned


def _way(start: float, end: float, step: float, stroke: Stroke, slowest: float) -> list[float]:
    """Positions every step from one to another as fast as the voltage drives them."""
    up, way = end > start, [start]
    while (way[-1] < end) == up:
        at = stroke.nearest(way[-1])
        local, volts = stroke.models[at], stroke.volts[at]
        left = VOLTAGE_LIMIT - volts if up else volts
        speed = max(DRIVEN_SHARE * local.gain / local.time_constant * left, slowest)
        way.append(way[-1] + (speed if up else -speed) * step)
    way[-1] = end
    return way


REPETITIONS = 3
"""How often voltages are nominal_rollout."""

LEARNED_SHARE = 0.7
"""Share of what an error calls for that is learned from a rollout."""

WINDOW_S = 0.2
"""Width of the window (s) over which errors are averaged: some lags of the plant."""

LEAST_LOAD_N = 5.0
"""Load (N) under which a cable may be slack, and an error tells nothing of the voltage."""


def nominal_rollout(station: StationInfo, volts: np.ndarray) -> np.ndarray:
    """What the nominal plant's sensors say at control instants under voltages, without noise.

    Args:
        station: nominal model, task, pressure, period, action delay.
        volts: actuator's voltage to be in force in every period (V), shape (steps,); held to
            0-10 V, and to where the trial begins until the first command is in force.
    Returns:
        Contraction (m) and rotation (rad) from the start, load (N), shape (3, steps + 1).
    """
    plant, (motor, regulator) = Plant(station.model), rest_voltages(station)
    moves_regulator = station.task.actuator == "regulator"
    commanded = np.clip(np.append(volts, volts[-1]), 0.0, VOLTAGE_LIMIT)
    commanded[: round(station.action_delay / station.period)] = (
        regulator if moves_regulator else motor
    )
    other = np.full(len(commanded), motor if moves_regulator else regulator)
    commands = (other, commanded) if moves_regulator else (commanded, other)
    start = plant.settle(motor, regulator_voltage=regulator)
    times = station.period * np.arange(len(commanded))
    states, zero = plant.run(times, *commands, interpolation="zoh", condition=start)
    said = plant.lagged(states, plant.observe(states, zero))
    measured = said[:, [plant.outputs.index(n) for n in ("contraction", "rotation", "load")]].T
    measured[:2] -= measured[:2, :1]
    return measured


def position_of(station: StationInfo, said: np.ndarray) -> np.ndarray:
    """The task's position (m or rad), shape (n,), from the result of `nominal_rollout`."""
    contraction, rotation, _ = said
    quantity = station.task.schedule.quantity
    return {"extension": -contraction, "rotation": rotation, "contraction": contraction}[quantity]


def improved(
    station: StationInfo, volts: np.ndarray, target: np.ndarray, stroke: Stroke
) -> np.ndarray:
    """Voltages after some rollouts, in each of which errors that stay are learned from.

        V[k] += share * mean of e / g over a window about k

    e is the plan less what the sensor says, g the static gain there. An inverse makes no error but
    for what its steps leave out, as friction's memory of a voltage that was held to a limit; of a
    few hundredths of a degree in a hold, a third is left. Where a voltage is beyond its limits, or
    the cable does not pull, it stays, and nothing is learned from there.

    Args:
        station: as of `nominal_rollout`.
        volts: to begin with (V), shape (steps,).
        target: planned position at control instants, as its sensor would say (m or rad), shape
            (steps + 1,).
        stroke: how the plant answers.
    """
    places = [stroke.nearest(position) for position in target[1:].tolist()]
    gains = np.array([stroke.models[place].gain for place in places])
    window = np.hanning(2 * round(0.5 * WINDOW_S / station.period) + 3)
    pulls = "cable" in station.model.parameters
    for _ in range(REPETITIONS):
        said = nominal_rollout(station, volts)
        error = target - position_of(station, said)
        possible = (volts >= 0.0) & (volts <= VOLTAGE_LIMIT)
        if pulls:
            possible &= said[2, 1:] > LEAST_LOAD_N
        called_for = np.convolve(np.where(possible, error[1:] / gains, 0.0), window, "same")
        weight = np.convolve(possible, window, "same")
        step = np.divide(called_for, weight, out=np.zeros_like(volts), where=possible)
        volts = volts + LEARNED_SHARE * step
    return volts


VOLTAGES_KEPT = 128
"""Motions whose voltages a process keeps."""


class NominalMotion:
    """The nominal plant along a reference.

    All times are those of the plant: `voltage(time)` is what should be *in force* in the period
    that begins at `time`. A command is in force `station.action_delay` later than it is sent, so
    a controller sends `command(time)`, which is `voltage(time + action_delay)`.

    The voltages aim at `planned`: the reference, but at rest until the first command is in force,
    and with a way as fast as the plant goes in place of a jump
    (`controllers.models.nominal_motion`).

    Attributes:
        reference: the reference (m or rad by s).
        station: the station.
        volts: voltage of every control period, not held to 0-10 V (V), shape (steps,).
        sensor_lag: lag of the sensor that reads the position (s).
        noise: standard deviation of that reading, the DAQ's rounding included (m or rad).
    """

    def __init__(
        self, reference: Reference, station: StationInfo, planned: np.ndarray, volts: np.ndarray
    ) -> None:
        self.reference, self.station, self.volts = reference, station, volts
        self._volts: list[float] = volts.tolist()
        self._planned: list[float] = planned.tolist()
        self._nodes_per_s = (len(planned) - 1) / (len(volts) * station.period)
        self.sensor_lag, self.noise = sensor_of(station, station.task.schedule.quantity)

    def voltage(self, time: float) -> float:
        """Voltage (V) that should be in force in the period that begins at a time (s).

        Not held to 0-10 V: beyond says by how much the motion asks for what the actuator cannot
        give. Before the trial begins that of the first period, after it ends that of the last.
        """
        at = int(time / self.station.period + 1e-6)
        return self._volts[min(max(at, 0), len(self._volts) - 1)]

    def command(self, time: float) -> float:
        """Voltage (V) to send at a time (s), for it is in force the action delay later."""
        return self.voltage(time + self.station.action_delay)

    def planned(self, time: float) -> float:
        """Position (m or rad) that the voltages aim at, at a time (s)."""
        share = max(time * self._nodes_per_s, 0.0)
        at = min(int(share), len(self._planned) - 2)
        low, high = self._planned[at], self._planned[at + 1]
        return low + min(share - at, 1.0) * (high - low)

    def expected(self, time: float) -> float:
        """Position (m or rad) that the sensor should say at a time (s): the planned one, lagged."""
        return self.planned(time - self.sensor_lag)

    def predicted(self, time: float) -> float:
        """Position (m or rad) that the nominal plant's sensor says at a control instant (s).

        Simulated under `voltage` as held to 0-10 V: what comes of the plan where a cable has to
        tighten first, or no voltage drives the plant as planned.
        """
        return self._position[self._instant(time)]

    def predicted_rotation(self, time: float) -> float:
        """Pulley angle (rad) that its sensor says then, whatever the task asks for."""
        return self._rotation[self._instant(time)]

    def _instant(self, time: float) -> int:
        return min(max(round(time / self.station.period), 0), len(self.volts))

    @cached_property
    def _said(self) -> np.ndarray:
        return nominal_rollout(self.station, self.volts)

    @cached_property
    def _position(self) -> list[float]:
        return position_of(self.station, self._said).tolist()

    @cached_property
    def _rotation(self) -> list[float]:
        return self._said[1].tolist()

    @cached_property
    def stroke(self) -> Stroke:
        """Local models over the stroke: the task's range, and beyond where the plan goes there."""
        return stroke_along(np.array(self._planned), self.station)

    def local(self, position: float) -> LocalModel:
        """The plant near a position (m or rad): the nearest of 101 places of the stroke."""
        return self.stroke.models[self.stroke.nearest(position)]

    def pressure_correction(self, position: float, pressure: float) -> float:
        """Voltage (V) to add so that a position is held although the pressure is another.

        From the nominal statics: the muscle pulls harder by dF/dP for every Pa above the pressure
        of the trial, and the motor has to hold against it. Noise of the pressure passes through,
        5 mV of it for 0.2 kPa.

        Args:
            position: where (m or rad).
            pressure: gauge pressure, measured or predicted (Pa).
        Returns:
            The correction; 0 where the regulator is the actuator.
        """
        slope = self.stroke.pressure_slopes[self.stroke.nearest(position)]
        return slope * (pressure - self.station.pressure)


def nominal_motion(reference: Reference, station: StationInfo) -> NominalMotion:
    """The nominal plant along a reference.

    Voltages and local models are kept for the process, so that many trials with one reference,
    pressure and control period compute them once; what is kept changes no result.

    Args:
        reference: what to follow; 0 at the start.
        station: nominal model, task, pressure, control period, delays.
    Raises:
        ValueError: the task is an exercise, which has no position to follow.
    """
    must_give_a_position(station)
    inverse = _inverse(ModelKey(station.model), station.task.actuator)
    parts, span = inverse.parts(station.period), station.task.schedule.span
    step, first = station.period / parts, round(parts * station.action_delay / station.period)
    planned = delayed_start(_sampled(reference, station, parts), first)
    if len(jumps(planned, span)):
        planned = without_jumps(planned, first, step, stroke_along(planned, station), span)
    return NominalMotion(reference, station, planned, _voltages(inverse, _Aim(planned, station)))


def _sampled(reference: Reference, station: StationInfo, parts: int) -> np.ndarray:
    """The reference at all nodes.

    One that is the task's own at every control instant is taken as that, and asked for all times
    at once, a hundred times as fast as one by one.
    """
    times = np.arange(station.task.steps(1.0 / station.period) * parts + 1) * station.period / parts
    own = np.asarray(station.task.schedule.reference(times))
    if np.array_equal(own[::parts], [reference(time) for time in times[::parts].tolist()]):
        return own
    return np.array([reference(time) for time in times.tolist()])


class _Aim:
    """A motion of a station, equal to every other for which a model needs the same voltages."""

    def __init__(self, planned: np.ndarray, station: StationInfo) -> None:
        self.planned, self.station, task = planned, station, station.task
        said = task.schedule.quantity, task.load, station.pressure
        self._key = *said, station.period, station.action_delay, planned.tobytes()

    def __hash__(self) -> int:
        return hash(self._key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Aim) and self._key == other._key


@lru_cache(maxsize=8)
def _inverse(nominal: ModelKey, actuator: str) -> Inverse:
    return inverse_of(nominal.model, actuator)


@lru_cache(maxsize=VOLTAGES_KEPT)
def _voltages(inverse: Inverse, aim: _Aim) -> np.ndarray:
    station, planned = aim.station, aim.planned
    volts = inverse.along(planned, station)
    parts = (len(planned) - 1) // len(volts)
    lag, _ = sensor_of(station, station.task.schedule.quantity)
    instants = station.period * np.arange(len(volts) + 1)
    target = np.interp(instants - lag, station.period / parts * np.arange(len(planned)), planned)
    volts = improved(station, volts, target, stroke_along(planned, station))
    volts.flags.writeable = False
    return volts
