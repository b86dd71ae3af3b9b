"""The joint's speed in an exercise, estimated from the sensors."""

import math

from pma_gym.envs import Measurement, StationInfo


class JointSpeed:
    """The extension's change over the nominal pulley's radius, through a filter of the first order.

    The LVDT is finer than the potentiometer. What the cable stretches is taken for no motion.

    Args:
        station: the station as the controller knows it.
        time_constant: of the filter (s).

    Attributes:
        speed: of late (rad/s).
    """

    def __init__(self, station: StationInfo, time_constant: float) -> None:
        self._rate = 1.0 / (station.period * station.model.parameters["rotor"].radius)
        self._kept = math.exp(-station.period / time_constant)
        self.speed = self._extension = 0.0

    def update(self, reading: Measurement) -> float:
        """Take a reading; the speed (rad/s)."""
        rate = self._rate * (reading.extension - self._extension)
        self._extension = reading.extension
        self.speed = rate + self._kept * (self.speed - rate)
        return self.speed
