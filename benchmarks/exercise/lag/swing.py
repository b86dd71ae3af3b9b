"""The largest moment of a frequency that a regulator can cancel, by its lag and its 0-10 V.

A pressure behind a lag of first order follows a voltage that swings about the one that holds the
exercise, V0, as far as 0-10 V let it to both sides, with

    |dP| = gain min(V0, 10 - V0) / sqrt(1 + (2 pi f tau)^2)

and a joint that stands still feels |dM| = (dM/dP) |dP|. A voltage that jumps between 0 and 10 V, V0
its mean, has a fundamental of (20/pi) sin(pi V0 / 10), the most that any can; its overtones come
along. What an operator's moment of that frequency is larger than moves the joint. Pressure is taken
to fill as fast as it can both ways: a bound.

Source:
    Closed form. The largest fundamental of a bounded wave is that of one that jumps from end to
    end.
"""

import math
from dataclasses import dataclass

from benchmarks.exercise.lag.points import Point, points
from pma_gym.engine.actions import HIGHEST_VOLTAGE
from pma_gym.plant.model import Model

FREQUENCIES_HZ = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 12.0)
"""Frequencies of the table (Hz): below 2 Hz unsteadiness, 8 to 12 Hz tremor."""


@dataclass(frozen=True)
class Swing:
    """Range that a regulator reaches near a point of an exercise.

    Attributes:
        point: where.
        lag: time constant of the regulator (s).
        gain: change of the pressure by the voltage (Pa/V).
    """

    point: Point
    lag: float
    gain: float

    def pressure(self, frequency: float) -> float:
        """Largest swing of the pressure to either side (Pa) at a frequency (Hz), as a sine."""
        return self.gain * self.point.room * self._left(frequency)

    def moment(self, frequency: float) -> float:
        """Largest moment (N m) that is cancelled at a frequency (Hz), with a sine of voltage."""
        return self.point.influence * self.pressure(frequency)

    def most(self, frequency: float) -> float:
        """Largest moment (N m) that any voltage of that mean cancels at a frequency (Hz)."""
        share = math.sin(math.pi * self.point.voltage / HIGHEST_VOLTAGE)
        volts = 2.0 / math.pi * HIGHEST_VOLTAGE * share
        return self.point.influence * self.gain * volts * self._left(frequency)

    def highest_frequency(self, moment: float) -> float:
        """Frequency (Hz) above which no voltage cancels a moment of such an amplitude (N m).

        0 where it is too large at rest too.
        """
        ratio = self.most(0.0) / moment
        return math.sqrt(max(0.0, ratio**2 - 1.0)) / (2.0 * math.pi * self.lag)

    def _left(self, frequency: float) -> float:
        return 1.0 / math.hypot(1.0, 2.0 * math.pi * frequency * self.lag)


def swings(task: str, model: Model) -> tuple[Swing, ...]:
    """Compute the range that a station's regulator reaches at every point of an exercise."""
    lag = model.parameters["regulator_lag"].time_constant
    gain = model.parameters["regulator_line"].gain
    return tuple(Swing(point, lag, gain) for point in points(task, model))
