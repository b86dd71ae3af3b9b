"""Sensor volts to units and back, by table 1 of the dissertation: the only such conversion."""

from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from pma_gym.codegen.generic import floor, where
from pma_gym.units import SI_FACTORS

Value = TypeVar("Value", float, NDArray[np.float64])

DAQ_LIMIT = 10.0
"""Range of the data acquisition card, either way from 0 (V)."""

DAQ_STEP = 2 * DAQ_LIMIT / 4096
"""One step of its 12-bit converter (V): 4.88 mV."""


@dataclass(frozen=True)
class Calibration:
    """Line that a sensor follows.

        volts = gain * value + offset

    Attributes:
        gain: (V per SI unit of what it senses).
        offset: its voltage at zero (V).
    """

    gain: float
    offset: float

    def to_volts(self, value: Value) -> Value:
        """Voltage (V) of the sensor at a value (SI); a float or an array of any shape."""
        return self.gain * value + self.offset

    def from_volts(self, volts: Value) -> Value:
        """Value (SI) that a voltage (V) stands for; a float or an array of any shape."""
        return (volts - self.offset) / self.gain

    @property
    def resolution(self) -> float:
        """Size of one step of the DAQ in the sensor's unit (SI)."""
        return DAQ_STEP / abs(self.gain)


def _table_1(gain: float, unit: str, offset: float) -> Calibration:
    """A line as printed: gain in volts per `unit`, offset in volts."""
    return Calibration(gain * SI_FACTORS[f"V/{unit}"], offset)


LVDT = _table_1(0.0979, "mm", -0.881)
"""Linear variable differential transducer: V = 0.0979 mm - 0.881.

It was calibrated by calipers "measuring the extension of the slide" (section 2.1.1.1). Neither the
direction of that slide nor where its zero lies on the muscle is printed. It is read here as the
muscle's contraction counted from the resting length, and its zero is free in every trial:
differences are what it measures. 0 V lies at 9.0 mm. Figure H1 prints an offset of -0.8806.
"""

LOAD_CELL = _table_1(0.0041, "N", 0.0347)
"""Load cell: V = 0.0041 N + 0.0347; calibrated with 222, 444 and 667 N, positive in tension."""

PRESSURE_TRANSDUCER = _table_1(1.02, "bar", 0.027)
"""Pressure transducer: V = 1.02 bar + 0.027, gauge pressure.

Figure H2 prints a gain of 1.015, which table 1 rounds: a pressure decoded by table 1 comes out
0.5 % lower. The "actual" pressures of tables I2 and I3 read about 1.016 times the commanded one
plus 3.4 kPa, as volts times 100 would by figure H2.
"""

POTENTIOMETER = _table_1(0.0142, "deg", 0.087)
"""Rotational potentiometer: V = 0.0142 deg + 0.087; range 0-320 deg.

Its zero is the protractor's, not the trial's: `Trial.rotation` counts from the trial's start.
"""


def quantise(volts: Any) -> Any:  # noqa: ANN401
    """Voltages as the DAQ records them.

    Args:
        volts: voltages at its inputs (V): a number, an array of any shape, or traced values.
    Returns:
        The nearest of its 4096 levels, -10 to 9.995 V; NaN stays NaN.
    """
    highest = DAQ_LIMIT - DAQ_STEP
    clipped = where(volts < -DAQ_LIMIT, -DAQ_LIMIT, where(volts > highest, highest, volts))
    return floor(clipped * (1.0 / DAQ_STEP) + 0.5) * DAQ_STEP
