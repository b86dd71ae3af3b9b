"""What an effect that is added to a station may depend on, and what leaves the station as it is.

The station (`pma_gym.plant.rigs.station`) computes its signals one after the other, and finds
its rest without the cable; so a law sees at its port what is known there. Rates of memories come
last and see everything. `tests/effects/test_user_effects.py` holds this table and the station
together.
"""

from dataclasses import dataclass

STATES = ("contraction", "velocity", "angle", "spin", "pressure")

EVERYTHING = (
    *(*STATES, "motor_voltage", "regulator_voltage"),
    *("load_asked", "load_command", "load_arriving", "pressure_asked", "pressure_command"),
    *("stretch", "stretch_rate", "cable_tension", "muscle_force", "slide_force"),
)
"""Signals that rates of memories see, beside `memory` and `p`."""

_RANGES = {
    "contraction": 0.03,
    "velocity": 0.1,
    "angle": 1.0,
    "motor_angle": -0.5,
    "spin": 4.0,
    "pressure": 300e3,
    "pressure_asked": 310e3,
    "pressure_command": 320e3,
    "motor_voltage": 3.0,
    "regulator_voltage": 5.0,
    "regulator_time_constant": 0.1,
    "stretch": 1e-3,
    "stretch_rate": 0.05,
    "signal": 0.7,
}


@dataclass(frozen=True)
class Place:
    """A port where effects can be added.

    Attributes:
        signals: what a law there may depend on, beside `memory` and `p`.
        absent: what a law gives there that changes nothing: a number, or the name of a signal.
    """

    signals: tuple[str, ...]
    absent: float | str


_MUSCLE = Place(("pressure", "contraction", "velocity"), 0.0)
_DAMPING = ("pressure", "contraction", "velocity", "cable_tension")
_SENSOR = Place(
    ("signal", "contraction", "velocity", "angle", "spin", "pressure", "cable_tension"), 0.0
)

PLACES: dict[str, Place] = {
    "muscle_force": _MUSCLE,
    "slide_force": _MUSCLE,
    "muscle_damping": Place(_DAMPING, 0.0),
    "damping_factor": Place(_DAMPING, 1.0),
    "drive_shape": Place(("load", "motor_voltage", "velocity", "spin", "pressure"), "load"),
    "drive_delay": Place(("load_asked", "motor_voltage"), "load_asked"),
    "drive_lag": Place(("load_command", "motor_voltage"), "load_command"),
    "drive_ripple": Place(
        ("load_arriving", "angle", "motor_angle", "spin", "velocity", "motor_voltage"), 0.0
    ),
    "regulator_delay": Place(("pressure_asked", "regulator_voltage"), "pressure_asked"),
    "regulator_pace": Place(("pressure", "pressure_command", "regulator_time_constant"), 1.0),
    "chamber": Place(("pressure", "contraction", "velocity"), 0.0),
    "sensor:contraction": _SENSOR,
    "sensor:rotation": _SENSOR,
    "sensor:load": _SENSOR,
    "sensor:pressure": _SENSOR,
}
"""Ports of a station where effects can be added, by name."""


def example(signal: str) -> float:
    """A number (SI) that a signal may well have."""
    return _RANGES.get(signal, 200.0)
