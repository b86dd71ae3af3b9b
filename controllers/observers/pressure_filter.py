"""Filter and predict the muscle's pressure: the part of it that was not commanded.

The regulator brings the pressure P to what it is commanded, C, and to what nobody asked for, J:

    P[k+1] = z P[k] + (1 - z) (C[k] + J[k]) + w_P,   J[k+1] = J[k] + w_J,   z = exp(-T / tau)

A Kalman filter of P and J. Where a reading lies further off than `INNOVATION_GATE` standard
deviations, J has jumped, by `JUMP_PA` or so: then the filter believes the readings, and else its
memory, so that little of the transducer's noise reaches the voltage. Knowing J it knows where the
pressure will be when a command comes into force.
"""

import math

from pma_gym.data.signals import SIGNALS
from pma_gym.envs import StationInfo

INNOVATION_GATE = 4.5
"""Standard deviations of a reading beyond which J has jumped, or the transducer has an offset."""

JUMP_PA = 25e3
"""By how much J jumps (Pa)."""

DRIFT_PA = 500.0
"""Standard deviation of J's change in a second (Pa/s^0.5)."""

PROCESS_NOISE_PA = 50.0
"""Standard deviation of the pressure's own change in a period (Pa): what moves it but C and J."""

PRESSURE = SIGNALS["pressure"]


class PressureFilter:
    """The filter; one reading a control period.

    Args:
        station: the nominal station, at its pressure.

    Attributes:
        pressure: estimate of the gauge pressure P (Pa).
        excess: estimate of J (Pa).
    """

    def __init__(self, station: StationInfo) -> None:
        parameters = station.model.parameters
        sensor = parameters.get(PRESSURE.sensor)
        rounding = PRESSURE.resolution / math.sqrt(12.0)
        self._noise = (0.0 if sensor is None else sensor.noise) ** 2 + rounding**2
        self._sensor_lag = 0.0 if sensor is None else 0.5 / (math.pi * sensor.bandwidth)
        self._lag = parameters["regulator_lag"].time_constant
        self._kept = math.exp(-station.period / self._lag)
        self._drift = DRIFT_PA**2 * station.period
        self.pressure, self.excess, self._offset = station.pressure, 0.0, None
        # Variance of P, covariance, variance of J: known at the start.
        self._own = self._both = self._excesses = 0.0

    def update(self, reading: float) -> None:
        """Take the transducer's reading (Pa) of a period's beginning."""
        if self._offset is None:
            # A trial begins at its pressure: what the transducer says beside it is its own.
            away = reading - self.pressure
            self._offset = away if away * away > INNOVATION_GATE**2 * self._noise else 0.0
        error, spread = reading - self._offset - self.pressure, self._own + self._noise
        if error * error > INNOVATION_GATE**2 * spread:
            # J jumped in the period before, and the pressure has gone part of the way.
            gone = 1.0 - self._kept
            self._excesses += JUMP_PA**2
            self._both += gone * JUMP_PA**2
            self._own += (gone * JUMP_PA) ** 2
            spread = self._own + self._noise
        gain, excess_gain = self._own / spread, self._both / spread
        self.pressure += gain * error
        self.excess += excess_gain * error
        self._excesses -= excess_gain * self._both
        self._both -= gain * self._both
        self._own -= gain * self._own

    def advance(self, commanded: float) -> None:
        """Let a control period pass in which a pressure C (Pa) was commanded."""
        z, gone = self._kept, 1.0 - self._kept
        self.pressure = z * self.pressure + gone * (commanded + self.excess)
        own = z * z * self._own + 2.0 * z * gone * self._both + gone * gone * self._excesses
        self._both = z * self._both + gone * self._excesses
        self._own = own + PROCESS_NOISE_PA**2
        self._excesses += self._drift

    def ahead(self, duration: float, commanded: float) -> float:
        """The pressure (Pa) after a while (s) of a command C (Pa), the sensor's lag made good."""
        goes_to = commanded + self.excess
        kept = math.exp(-(duration + self._sensor_lag) / self._lag)
        return goes_to + kept * (self.pressure - goes_to)
