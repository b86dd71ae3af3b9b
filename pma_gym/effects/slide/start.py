"""Initial position and speed of a free slide."""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class Start(NamedTuple):
    """Initial state of a free slide; the plant reads it directly."""

    contraction: Annotated[
        float, Quantity("mm", -1e5, 1e5, "each trial's own: its first readings", 0.0, usual=10)
    ]
    velocity: Annotated[
        float, Quantity("mm/s", -1e5, 1e5, "each trial's own: its first readings", 0.0, usual=50)
    ]


START = Effect(name="start", port="part", parameters=Start, held=("contraction", "velocity"))
