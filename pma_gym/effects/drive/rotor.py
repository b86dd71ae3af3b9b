"""The motor's rotor and the pulley on it."""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class Rotor(NamedTuple):
    """Inertia, damping and pulley radius of the rotor; the plant reads them directly."""

    inertia: Annotated[
        float,
        Quantity("kg m^2", 1e-6, 1, "assumption: 2.0e-3, 1e-3 to 3e-3 plausible", usual=0.002),
    ]
    damping: Annotated[
        float, Quantity("N m s", 0, 1, "Serres 2008, table 3: 7.64e-4", usual=0.000764)
    ]
    radius: Annotated[
        float,
        Quantity(
            "mm", 1, 500, "Serres 2008, table I3, rotation against extension: 25.4", usual=25.4
        ),
    ]


ROTOR = Effect(name="rotor", port="part", parameters=Rotor)
