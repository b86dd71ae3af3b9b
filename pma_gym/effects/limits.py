"""Physical limits that end an episode, and the range in which a model is valid."""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

_REACH = "reach of Serres 2008, table I3, with margin"


class Limits(NamedTuple):
    """Physical limits of a rig; environments end an episode beyond them."""

    contraction: Annotated[float, Quantity("mm", 0, 1000, f"{_REACH}: 70", usual=70)]
    stretch: Annotated[
        float, Quantity("mm", 0, 1000, f"{_REACH}: 12 beyond the resting length", usual=12)
    ]
    tension: Annotated[float, Quantity("N", 0, 1e5, f"{_REACH}: 1300", usual=1300)]
    pressure: Annotated[float, Quantity("kPa", 0, 2000, "MAS-20 rating: 600", usual=600)]


class Validity(NamedTuple):
    """Range of pressures that a model was identified at; results beyond it are flagged."""

    lowest: Annotated[float, Quantity("kPa", 0, 2000, "Serres 2008, table I3: 150", usual=150)]
    highest: Annotated[float, Quantity("kPa", 0, 2000, "Serres 2008, table I3: 575", usual=575)]


class JointRange(NamedTuple):
    """Range of a muscle's joint, in which it is at rest, and the end of it with dry friction."""

    lowest: Annotated[float, Quantity("deg", -360, 0, "assumption: -60", usual=-60)]
    highest: Annotated[float, Quantity("deg", 0, 360, "assumption: 60", usual=60)]
    pressure: Annotated[float, Quantity("kPa", 0, 2000, "MAS-20 rating: 600", usual=600)]
    arrival: Annotated[
        float,
        Quantity(
            *("1", -1, 1, "0: friction carries nothing; 1 or -1: it came from below or above"),
            usual=0,
        ),
    ] = 0.0


LIMITS = Effect("limits", "part", Limits)
VALIDITY = Effect("validity", "part", Validity)
JOINT_RANGE = Effect("joint_range", "part", JointRange)
