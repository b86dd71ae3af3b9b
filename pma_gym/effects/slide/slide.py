"""The moving mass: half the muscle, the slide and the connectors."""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class Slide(NamedTuple):
    """Moving mass; the plant reads it directly."""

    mass: Annotated[float, Quantity("kg", 1e-3, 1000, "assumption: 0.5", usual=0.5)]


SLIDE = Effect(name="slide", port="part", parameters=Slide)
