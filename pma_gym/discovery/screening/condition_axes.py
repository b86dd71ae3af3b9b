"""What conditions of a rig are called and given in, by the signals that the rig has."""

from collections.abc import Sequence
from dataclasses import dataclass

from pma_gym.data.signals import Signal
from pma_gym.discovery.screening.time_bins import POSITIONS

NO_POSITION = Signal("position", "1", "derived", "displacement", "none that a sensor measures")
"""Stands in where a rig measures no position: nothing is said of its motion."""


@dataclass(frozen=True)
class Axis:
    """A condition that has a size.

    Attributes:
        kind: its field in `TimeBins`.
        words: what it is.
        unit: what it is given in there.
    """

    kind: str
    words: str
    unit: str


@dataclass(frozen=True)
class ConditionAxes:
    """The conditions of a rig.

    Attributes:
        levels: pressure, force and position, as far as the rig has them.
        speed: of its position.
        forwards, backwards: what it does while the position grows, and while it falls.
    """

    levels: tuple[Axis, ...]
    speed: Axis
    forwards: str
    backwards: str


def condition_axes(signals: Sequence[Signal]) -> ConditionAxes:
    """The conditions of a rig that measures some signals."""
    position = next((each for each in signals if each.measures in POSITIONS), NO_POSITION)
    kinds = (("pressure", ("pressure",)), ("load", ("force", "torque")), ("position", POSITIONS))
    levels = []
    for kind, measures in kinds:
        measured = next((each for each in signals if each.measures in measures), None)
        if measured is not None:
            levels.append(Axis(kind, measured.name, measured.unit))
    speed = Axis("speed", f"speed of {position.name}", f"{position.unit}/s")
    return ConditionAxes(tuple(levels), speed, position.forwards, position.backwards)
