"""Open-loop controllers: the dissertation's, and one without its faults."""

import math

import numpy as np

from controllers.controller import Reference
from controllers.inverse import VOLTAGE_LIMIT, Inverse, inverse_of
from controllers.serres import SerresFeedforward, SerresReplay
from pma_gym.envs import Reading, Station
from pma_gym.plant.model import Model

__all__ = ["ImprovedFeedforward", "SerresFeedforward", "SerresReplay"]


class ImprovedFeedforward:
    """The voltage that the nominal model needs for the reference, one value a control period.

        V = map^-1(y_ref) + lag compensation

    What it mends of the dissertation's feed-forward: the lag is inverted in continuous time, so
    there is no root at z = -1 and the voltage does not alternate; the map is the model's own
    balance of forces, neither a quadratic nor rounded; the drive's dead zone and the cable's
    slack are passed at once; voltages belong to control periods, not to 0.2 s. See
    `controllers.inverse` for the derivation. Where the model needs less than 0 or more than 10 V
    it asks for the limit.

    It sees no sensor: what the model does not know stays as error.
    """

    name = "improved_feedforward"

    def __init__(self) -> None:
        self._model: Model | None = None
        self._inverse: Inverse | None = None
        self._volts = np.zeros(1)
        self._period = 1.0

    def reset(self, reference: Reference, station: Station) -> None:
        """Compute the voltages of the whole trial."""
        if self._inverse is None or self._model is not station.model:
            self._model, self._inverse = station.model, inverse_of(station.model)
        self._period = station.period
        steps = math.ceil(station.task.duration / station.period - 1e-9)
        self._volts = self._inverse(reference, station, steps)

    def act(self, observation: Reading, time: float) -> float:
        """Motor voltage (V) for the period that begins at this time (s)."""
        return min(max(self.voltage(time), 0.0), VOLTAGE_LIMIT)

    def voltage(self, time: float) -> float:
        """Voltage (V) that the motion needs at a time (s), also where the drive cannot give it.

        After the trial's end that of the last period.
        """
        at = math.floor(time / self._period + 1e-6)
        return float(self._volts[min(max(at, 0), len(self._volts) - 1)])
