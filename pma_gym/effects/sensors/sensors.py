"""Sensors with first-order lag, calibration line and noise: one law, one set of parameters each."""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

_ASSUMED = "assumption"


def _bandwidth(usual: float) -> Quantity:
    """Bounds of a sensor's bandwidth, with its usual value (Hz)."""
    return Quantity(
        *("Hz", 1, 1e5, f"{_ASSUMED}: {usual:g}"),
        usual=usual,
        instead="a sensor without lag and noise is one without its table: leave that out",
    )


def _noise(unit: str, most: float, usual: float) -> Quantity:
    """Bounds of the standard deviation of a sensor's noise, with its usual value.

    The one place of these usual values: a model file states its own.
    """
    source = f"{_ASSUMED}: {usual:g} (standard deviation)"
    return Quantity(unit, 0, most, source, 0.0, usual=usual)


class Lvdt(NamedTuple):
    """Displacement of the muscle (contraction)."""

    bandwidth: Annotated[float, _bandwidth(100)]
    noise: Annotated[float, _noise("mm", 10, 0.02)]


class LoadCell(NamedTuple):
    """Tension of the cable."""

    bandwidth: Annotated[float, _bandwidth(500)]
    noise: Annotated[float, _noise("N", 100, 0.5)]


class PressureTransducer(NamedTuple):
    """Gauge pressure in the muscle."""

    bandwidth: Annotated[float, _bandwidth(50)]
    noise: Annotated[float, _noise("kPa", 100, 0.3)]


class Potentiometer(NamedTuple):
    """Angle of the pulley."""

    bandwidth: Annotated[float, _bandwidth(200)]
    noise: Annotated[float, _noise("deg", 45, 0.1)]


class Encoder(NamedTuple):
    """Angle of a joint."""

    bandwidth: Annotated[float, _bandwidth(1000)]
    noise: Annotated[float, _noise("deg", 45, 0.02)]


class Gyroscope(NamedTuple):
    """Speed of a joint."""

    bandwidth: Annotated[float, _bandwidth(200)]
    noise: Annotated[float, _noise("rad/s", 1e3, 0.02)]


class Tachometer(NamedTuple):
    """Speed of a slide."""

    bandwidth: Annotated[float, _bandwidth(200)]
    noise: Annotated[float, _noise("mm/s", 1e4, 0.5)]


class ForceSensor(NamedTuple):
    """Force at a drive that imposes a motion."""

    bandwidth: Annotated[float, _bandwidth(1000)]
    noise: Annotated[float, _noise("N", 1e5, 0.5)]


def sensor_rate(signal, p):
    """Rate of a sensor's output before noise: s' = (signal - s) / tau, tau = 1 / (2 pi f).

    Args:
        signal: input of the sensor (SI).
        p: the sensor's parameters; bandwidth f (Hz, -3 dB).
    Returns:
        (source, decay) with s' = source - decay * s.
    """
    decay = 6.283185307179586 * p.bandwidth
    return decay * signal, decay


_SIGNATURE = (
    "this sensor comes later than the others, by a lag of 1 / (2 pi bandwidth); noise that is the "
    "same at rest and in motion"
)


def _sensor(name: str, output: str, parameters: type) -> Effect:
    return Effect(name, f"sensor:{output}", parameters, rate=sensor_rate, signature=_SIGNATURE)


LVDT = _sensor("lvdt", "contraction", Lvdt)
LOAD_CELL = _sensor("load_cell", "load", LoadCell)
PRESSURE_TRANSDUCER = _sensor("pressure_transducer", "pressure", PressureTransducer)
POTENTIOMETER = _sensor("potentiometer", "rotation", Potentiometer)

ENCODER = _sensor("encoder", "angle", Encoder)
GYROSCOPE = _sensor("gyroscope", "speed", Gyroscope)

TACHOMETER = _sensor("tachometer", "velocity", Tachometer)

FORCE_SENSOR = _sensor("force_sensor", "force", ForceSensor)

JOINT_SENSORS: tuple[Effect, ...] = (ENCODER, GYROSCOPE)
"""Sensors of a joint, as effects of the catalogue."""

SENSORS: tuple[Effect, ...] = (LVDT, LOAD_CELL, PRESSURE_TRANSDUCER, POTENTIOMETER)
"""All sensors, as effects of the catalogue."""
