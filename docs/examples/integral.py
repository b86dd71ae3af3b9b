"""An example of a controller: integral action on the measured position."""

from controllers import Reference
from pma_gym.envs import Measurement, StationInfo


class Integral:
    """The voltage rises while the position lags behind, and falls while it leads."""

    name = "integral"

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """Prepare for a trial."""
        self.reference = reference
        self.period = station.period
        self.rotation = station.task.name == "rotation"
        # V/s for an error of 1 rad or 1 m.
        self.gain = 40.0 if self.rotation else 2500.0
        self.volts = 0.0

    def act(self, measurement: Measurement, time: float) -> float:
        """Motor voltage (V) for the next control period; extension in m, rotation in rad."""
        measured = measurement.rotation if self.rotation else measurement.extension
        self.volts += self.gain * self.period * (self.reference(time) - measured)
        self.volts = min(max(self.volts, 0.0), 10.0)
        return self.volts
