"""Calibration errors of sensors: a gain error and an offset each, before the sensor's lag.

A model can have them only together with the sensor's table (`lvdt`, `load_cell`, ...), whose lag
filters them. The zeros of contraction and rotation are free parameters of every trial, so those two
offsets are visible only where a sensor is not zeroed for each trial.
"""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

_GAIN = Quantity("%", -50, 50, "assumption: calibrations hold to 1-2", 0.0, usual=1.5)


class LvdtError(NamedTuple):
    """Error of the measured contraction."""

    gain: Annotated[float, _GAIN]
    offset: Annotated[float, Quantity("mm", -20, 20, "assumption: 0.5", 0.0, usual=0.5)]


class LoadCellError(NamedTuple):
    """Error of the measured tension."""

    gain: Annotated[float, _GAIN]
    offset: Annotated[float, Quantity("N", -200, 200, "assumption: 5", 0.0, usual=5)]


class PressureTransducerError(NamedTuple):
    """Error of the measured pressure."""

    gain: Annotated[
        float,
        Quantity(
            "%",
            -50,
            50,
            "Serres 2008, tables I2 and I3 read 1.016 P + 3.4 kPa: 1.6",
            0.0,
            usual=1.6,
        ),
    ]
    offset: Annotated[float, Quantity("kPa", -100, 100, "the same: 3.4", 0.0, usual=3.4)]


class PotentiometerError(NamedTuple):
    """Error of the measured angle."""

    gain: Annotated[float, _GAIN]
    offset: Annotated[float, Quantity("deg", -45, 45, "assumption: 1", 0.0, usual=1)]


class ForceSensorError(NamedTuple):
    """Error of the force measured at a drive that imposes a motion."""

    gain: Annotated[float, _GAIN]
    offset: Annotated[float, Quantity("N", -1e5, 1e5, "assumption: 5", 0.0, usual=5)]


def sensor_error(signal, p):
    """Error of a sensor before its lag.

        error = gain signal + offset

    Args:
        signal: the true value (SI).
        p: the sensor's error: gain (share), offset (SI).
    Returns:
        Error (SI), added to the true value.
    Source:
        A straight calibration line with errors in gain and offset.
    """
    return p.gain * signal + p.offset


_SIGNATURE = (
    "this sensor disagrees with the others statically, in proportion or by a constant, and nothing "
    "that is done to the station follows the error"
)


def _error(sensor: str, output: str, parameters: type) -> Effect:
    return Effect(
        name=f"{sensor}_error",
        port=f"sensor:{output}",
        parameters=parameters,
        law=sensor_error,
        signature=_SIGNATURE,
    )


LVDT_ERROR = _error("lvdt", "contraction", LvdtError)
LOAD_CELL_ERROR = _error("load_cell", "load", LoadCellError)
PRESSURE_TRANSDUCER_ERROR = _error("pressure_transducer", "pressure", PressureTransducerError)
POTENTIOMETER_ERROR = _error("potentiometer", "rotation", PotentiometerError)
FORCE_SENSOR_ERROR = _error("force_sensor", "force", ForceSensorError)
