"""Where an episode ends: what the rig was never shown to survive."""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

_REACH = "reach of Serres 2008, table I3, with margin"


class Limits(NamedTuple):
    """Physical limits of a rig; the environments read them."""

    contraction: Annotated[float, Quantity("mm", 0, 1000, f"{_REACH}: 70", usual=70)]
    stretch: Annotated[
        float, Quantity("mm", 0, 1000, f"{_REACH}: 12 beyond the resting length", usual=12)
    ]
    tension: Annotated[float, Quantity("N", 0, 1e5, f"{_REACH}: 1300", usual=1300)]
    pressure: Annotated[float, Quantity("kPa", 0, 2000, "MAS-20 rating: 600", usual=600)]


class Validity(NamedTuple):
    """Pressures that the numbers of a model were identified on; beyond them results are flagged."""

    lowest: Annotated[float, Quantity("kPa", 0, 2000, "Serres 2008, table I3: 150", usual=150)]
    highest: Annotated[float, Quantity("kPa", 0, 2000, "Serres 2008, table I3: 575", usual=575)]


LIMITS = Effect("limits", "part", Limits)
VALIDITY = Effect("validity", "part", Validity)
