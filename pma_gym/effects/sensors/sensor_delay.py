"""Readings that are late by a fixed time: two loggers, a bus, a block of samples.

A reading is smooth where a command may step, and it is read to a part in a thousand or better. So
the ladder of `pma_gym.effects.delay` has here the response of a Pade approximation of order [2/4],
whose amplitude is true too. The errors for a delay T at frequency f, with w = 2 pi f T, are

    phase       1e-7 rad at w = 0.5, 1e-5 rad at w = 1, 1e-3 rad at w = 2
    amplitude   1e-8 at w = 0.5, 4e-6 at w = 1, 8e-4 at w = 2

The price is a step, which goes the wrong way by a tenth of it before it comes.
"""

from typing import Annotated, NamedTuple

from pma_gym.effects.delay import ladder
from pma_gym.effects.effect import Effect
from pma_gym.effects.sensors.sensors import FORCE_SENSOR, JOINT_SENSORS, SENSORS, TACHOMETER
from pma_gym.units import Quantity

ELEMENTS = (1.0 / 12.0, 3.0 / 13.0, 169.0 / 510.0, 17.0 / 39.0)
"""Time constants of the ladder over the delay, from s^4 + 12 s^3 + 72 s^2 + 240 s + 360 (Routh)."""

OUTPUT = (3.0 / 13.0, -13.0 / 17.0, 10.0 / 13.0)
"""Weights of m_2, m_3 and m_4, for the numerator 12 s^2 - 120 s + 360."""

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
        Pade approximation of order [2/4] of exp(-s T) as a ladder; the module has its errors.
    """
    late = sum(weight * state for weight, state in zip(OUTPUT, memory[1:], strict=True))
    return (signal - p.share * signal) + late


def late_reading_rate(signal, memory, p):
    """Rates of the ladder's states between the true value and the sensor.

    Args:
        signal: the true value with the sensor's errors (SI).
        memory: the ladder (SI).
        p: the sensor's delay.
    Returns:
        For each memory (source, decay) with m' = source - decay * m (SI per s).
    """
    return ladder(p.share * signal, memory, p.delay, ELEMENTS)


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
