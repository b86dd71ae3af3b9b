"""The nominal plant along a reference: the voltage it needs, and how it answers near there."""

from functools import cached_property, lru_cache

import numpy as np

from controllers.controller import Reference
from controllers.design.designs import must_give_a_position
from controllers.models.inverse import Inverse, inverse_of
from controllers.models.local_model import LocalModel, Stroke
from controllers.models.nominal_rollout import (
    begun_late,
    improved,
    jumps,
    nominal_rollout,
    position_of,
    without_jumps,
)
from controllers.models.operating_range import ModelKey, sensor_of, stroke_along
from pma_gym.envs import StationInfo

VOLTAGES_KEPT = 128
"""Motions whose voltages a process keeps."""


class NominalMotion:
    """The nominal plant along a reference.

    All times are those of the plant: `voltage(time)` is what should be *in force* in the period
    that begins at `time`. A command is in force `station.action_delay` later than it is sent, so
    a controller sends `command(time)`, which is `voltage(time + action_delay)`.

    The voltages aim at `planned`: the reference, but at rest until the first command is in force,
    and with a way as fast as the plant goes in place of a jump
    (`controllers.models.nominal_rollout`).

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
    planned = begun_late(_sampled(reference, station, parts), first)
    if len(jumps(planned, span)):
        stroke = stroke_along(planned, station)
        planned = without_jumps(planned, first, step, stroke, span)
    volts = _voltages(inverse, _Aim(planned, station))
    return NominalMotion(reference, station, planned, volts)


def _sampled(reference: Reference, station: StationInfo, parts: int) -> np.ndarray:
    """The reference at all nodes.

    One that is the task's own at every control instant is taken as that, and asked for all times
    at once, a hundred times as fast as one by one.
    """
    count = station.task.steps(1.0 / station.period) * parts + 1
    times = np.arange(count) * station.period / parts
    own = np.asarray(station.task.schedule.reference(times))
    instants = [reference(time) for time in times[::parts].tolist()]
    if np.array_equal(own[::parts], instants):
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
    nodes = station.period / parts * np.arange(len(planned))
    wanted = np.interp(instants - lag, nodes, planned)
    volts = improved(station, volts, wanted, stroke_along(planned, station))
    volts.flags.writeable = False
    return volts
