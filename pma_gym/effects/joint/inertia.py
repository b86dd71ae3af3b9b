"""What turns with a joint, and where and how fast it is when a trial begins."""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class Inertia(NamedTuple):
    """Moment of inertia about the axis; the rig reads it itself."""

    inertia: Annotated[
        float, Quantity("kg m^2", 1e-9, 1e5, "assumption: 5e-3, 0.5 kg on 0.1 m", usual=5e-3)
    ]


class JointStart(NamedTuple):
    """State of a joint at the beginning; the rig reads it itself."""

    angle: Annotated[
        float, Quantity("deg", -1e6, 1e6, "each trial's own: its first readings", 0.0, usual=10)
    ]
    spin: Annotated[
        float, Quantity("deg/s", -1e6, 1e6, "each trial's own: its first readings", 0.0, usual=50)
    ]


INERTIA = Effect(name="inertia", port="part", parameters=Inertia)
JOINT_START = Effect(name="joint_start", port="part", parameters=JointStart, held=("angle", "spin"))
