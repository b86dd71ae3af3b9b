"""Readings that are late by a fixed time: two loggers, a bus, a block of samples.

The law is that of a late command (`pma_gym.effects.delay`, with its errors). A reading is smooth
where a command may step, so the step's price is not paid here.
"""

from typing import Annotated, NamedTuple

from pma_gym.effects.delay import ELEMENTS, late, late_rate
from pma_gym.effects.effect import Effect
from pma_gym.effects.sensors.sensors import FORCE_SENSOR, JOINT_SENSORS, SENSORS, TACHOMETER
from pma_gym.units import Quantity

_SHARE = Quantity("1", 0, 1, "1 for a delay of every reading", 0.0, usual=1)
_DELAY = Quantity(
    "ms", 0.001, 500, "assumption: two loggers that nothing synchronises are 5-20 apart", usual=10
)


class SensorDelay(NamedTuple):
    """Delay of what a sensor reads."""

    share: Annotated[float, _SHARE]
    delay: Annotated[float, _DELAY]


def late_reading(signal, memory, p):
    """Value that a sensor receives a fixed time after it was true.

        s_out = (1 - share) s + 3/13 m_2 - 13/17 m_3 + 10/13 m_4

    Args:
        signal: the true value s with the sensor's errors (SI).
        memory: the ladder m_1 to m_4 (SI).
        p: the sensor's delay: share, delay (s).
    Returns:
        Value (SI), before the sensor's lag.
    Source:
        Pade approximation of order [2/4] of exp(-s T) as a ladder, with the errors that
        `pma_gym.effects.delay` states.
    """
    return late(signal, memory, p.share)


def late_reading_rate(signal, memory, p):
    """Rates of the ladder's states between the true value and the sensor.

    Args:
        signal: the true value with the sensor's errors (SI).
        memory: the ladder (SI).
        p: the sensor's delay.
    Returns:
        For each memory (source, decay) with m' = source - decay * m (SI per s).
    """
    return late_rate(signal, memory, p.share, p.delay)


def _delay(sensor: Effect) -> Effect:
    return Effect(
        name=f"{sensor.name}_delay",
        port=sensor.port.replace("sensor:", "sensor_delay:"),
        parameters=SensorDelay,
        law=late_reading,
        rate=late_reading_rate,
        signature=(
            "this sensor is later than commands and other sensors, by the same time at every "
            "frequency; the truth is not"
        ),
        memories=len(ELEMENTS),
        held=("share",),
    )


SENSOR_DELAYS: tuple[Effect, ...] = tuple(
    _delay(sensor) for sensor in (*SENSORS, *JOINT_SENSORS, TACHOMETER, FORCE_SENSOR)
)
"""Delays of all sensors, as effects of the catalogue."""
