"""Voltages between samples 0.2 s apart, as the dissertation's station was driven."""

from typing import Literal

import numpy as np

from pma_gym.envs import Measurement

Hold = Literal["linear", "zero"]


HOLDS = ("linear", "zero")


class VoltageTable:
    """Motor voltage by time, between samples 0.2 s apart; what both controllers here replay.

    Args:
        hold: `linear` joins the samples by lines; `zero` holds each until the next. The
            dissertation does not say which its station did.

    Attributes:
        times: times of the samples (s).
        volts: motor voltages there (V).
    """

    name = "voltage_table"

    def __init__(self, hold: Hold = "linear") -> None:
        if hold not in HOLDS:
            raise ValueError(f"hold must be one of {', '.join(HOLDS)}, got {hold!r}")
        self.hold = hold
        self.times = np.zeros(1)
        self.volts = np.zeros(1)
        self._period = 0.0

    def voltage(self, time: float) -> float:
        """Motor voltage (V) at a time (s); the last sample's from there on."""
        if self.hold == "linear":
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
