"""Voltages between samples 0.2 s apart, as the dissertation's station was driven."""

import numpy as np

from pma_gym.envs import Measurement
from pma_gym.integrator.equations import Interpolation, check_interpolation


class VoltageTable:
    """Motor voltage by time, between samples 0.2 s apart; what both controllers here replay.

    Args:
        interpolation: `foh` joins the samples by lines; `zoh` holds each until the next. The
            dissertation does not say which its station did.

    Attributes:
        times: times of the samples (s).
        volts: motor voltages there (V).
    """

    name = "voltage_table"

    def __init__(self, interpolation: Interpolation = "foh") -> None:
        check_interpolation(interpolation)
        self.interpolation = interpolation
        self.times = np.zeros(1)
        self.volts = np.zeros(1)
        self._period = 0.0

    def voltage(self, time: float) -> float:
        """Motor voltage (V) at a time (s); the last sample's from there on."""
        if self.interpolation == "foh":
            return float(np.interp(time, self.times, self.volts))
        # A sample begins at its time, also when that time went through a division.
        at = int(np.searchsorted(self.times, time + 1e-9, side="right")) - 1
        return float(self.volts[max(at, 0)])

    def act(self, measurement: Measurement, time: float) -> float:
        """Motor voltage (V) in the middle of the period for which it is held.

        The mean of a line over a period is its value in the middle, so the replay does not lag
        behind the printed one by half a period, whatever the control rate.
        """
        return self.voltage(time + 0.5 * self._period)
