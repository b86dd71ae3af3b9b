"""Readings that are late by a fixed time: two loggers, a bus, a block of samples."""

from typing import Annotated, NamedTuple

from pma_gym.effects.delay import ELEMENTS, ladder
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

_SHARE = Quantity("1", 0, 1, "1 for a delay of every reading", 0.0, usual=1)
_DELAY = Quantity(
    "ms", 0.1, 500, "assumption: two loggers that nothing synchronises are 5-20 apart", usual=10
)


class LvdtDelay(NamedTuple):
    """Delay of the measured contraction."""

    share: Annotated[float, _SHARE]
    delay: Annotated[float, _DELAY]


class LoadCellDelay(NamedTuple):
    """Delay of the measured tension."""

    share: Annotated[float, _SHARE]
    delay: Annotated[float, _DELAY]


class PressureTransducerDelay(NamedTuple):
    """Delay of the measured pressure."""

    share: Annotated[float, _SHARE]
    delay: Annotated[float, _DELAY]


class PotentiometerDelay(NamedTuple):
    """Delay of the measured angle of the pulley."""

    share: Annotated[float, _SHARE]
    delay: Annotated[float, _DELAY]


class EncoderDelay(NamedTuple):
    """Delay of the measured angle of a joint."""

    share: Annotated[float, _SHARE]
    delay: Annotated[float, _DELAY]


class GyroscopeDelay(NamedTuple):
    """Delay of the measured speed of a joint."""

    share: Annotated[float, _SHARE]
    delay: Annotated[float, _DELAY]


class TachometerDelay(NamedTuple):
    """Delay of the measured speed of a slide."""

    share: Annotated[float, _SHARE]
    delay: Annotated[float, _DELAY]


class ForceSensorDelay(NamedTuple):
    """Delay of the force measured at a drive that imposes a motion."""

    share: Annotated[float, _SHARE]
    delay: Annotated[float, _DELAY]


def late_reading(signal, memory, p):
    """Value that a sensor receives a fixed time after it was true.

        s_out = (1 - share) s + m_4

    Args:
        signal: the true value s with the sensor's errors (SI).
        memory: the ladder m_1 to m_4 (SI); m_4 is share s, one delay ago.
        p: the sensor's delay: share, delay (s).
    Returns:
        Value (SI), before the sensor's lag.
    Source:
        Bessel's filter of fourth order (W. E. Thomson 1949) as a ladder; `pma_gym.effects.delay`
        has its errors.
    """
    return (signal - p.share * signal) + memory[-1]


def late_reading_rate(signal, memory, p):
    """Rates of the ladder's states between the true value and the sensor.

    Args:
        signal: the true value with the sensor's errors (SI).
        memory: the ladder (SI).
        p: the sensor's delay.
    Returns:
        For each memory (source, decay) with m' = source - decay * m (SI per s).
    """
    return ladder(p.share * signal, memory, p.delay)


def _delay(sensor: str, output: str, parameters: type) -> Effect:
    return Effect(
        name=f"{sensor}_delay",
        port=f"sensor_delay:{output}",
        parameters=parameters,
        law=late_reading,
        rate=late_reading_rate,
        signature=(
            "this sensor is later than commands and other sensors, by the same time at every "
            "frequency; the truth is not"
        ),
        memories=len(ELEMENTS),
        held=("share",),
    )


SENSOR_DELAYS: tuple[Effect, ...] = (
    _delay("lvdt", "contraction", LvdtDelay),
    _delay("load_cell", "load", LoadCellDelay),
    _delay("pressure_transducer", "pressure", PressureTransducerDelay),
    _delay("potentiometer", "rotation", PotentiometerDelay),
    _delay("encoder", "angle", EncoderDelay),
    _delay("gyroscope", "speed", GyroscopeDelay),
    _delay("tachometer", "velocity", TachometerDelay),
    _delay("force_sensor", "force", ForceSensorDelay),
)
"""Delays of all sensors, as effects of the catalogue."""
