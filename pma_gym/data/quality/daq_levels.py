"""Readings of the station's 12-bit DAQ, known by their levels.

Steps and ends of that DAQ hold only for its own readings. A signal was read by it if its readings
differ from each other by whole steps of it; those of another lab's sensor do not.
"""

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.calibration import DAQ_LIMIT, DAQ_STEP
from pma_gym.data.signals import Signal

Array = NDArray[np.float64]

MISS = 0.05
"""Share of a step that a reading may miss a whole one by: files round."""


def read_by_daq(signal: Signal, readings: Array) -> bool:
    """Test whether readings (SI, NaN for none) differ by whole steps of the DAQ."""
    if signal.calibration is None:
        return False
    known = readings[np.isfinite(readings)]
    if not known.size:
        return False
    steps = (known - known[0]) / signal.resolution
    return bool(np.all(np.abs(steps - np.round(steps)) < MISS))


def at_daq_end(signal: Signal, readings: Array) -> NDArray[np.bool_]:
    """Mark readings (SI, any shape) at an end of the DAQ's range; none of other sensors.

    Such a reading is only a bound on the true value.
    """
    nowhere = np.zeros(readings.shape, bool)
    # Counted from its start, a signal no longer tells at which level it began.
    if signal.calibration is None or signal.starts_at_zero:
        return nowhere
    volts = np.abs(signal.calibration.to_volts(readings))
    at = volts >= DAQ_LIMIT - (1.0 + MISS) * DAQ_STEP
    beyond = volts > DAQ_LIMIT + MISS * DAQ_STEP
    return at if at.any() and not beyond.any() and read_by_daq(signal, readings) else nowhere
