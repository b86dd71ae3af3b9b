"""Moment of inertia of a joint, and its angle and speed at the start of a trial."""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class Inertia(NamedTuple):
    """Moment of inertia about the axis; the rig reads it directly."""

    inertia: Annotated[
        float, Quantity("kg m^2", 1e-9, 1e5, "assumption: 5e-3, 0.5 kg on 0.1 m", usual=5e-3)
    ]


class JointStart(NamedTuple):
    """Initial state of a joint; the rig reads it directly."""

    angle: Annotated[
        float, Quantity("deg", -1e6, 1e6, "each trial's own: its first readings", 0.0, usual=10)
    ]
    spin: Annotated[
        float, Quantity("deg/s", -1e6, 1e6, "each trial's own: its first readings", 0.0, usual=50)
    ]


INERTIA = Effect(name="inertia", port="part", parameters=Inertia)
JOINT_START = Effect(name="joint_start", port="part", parameters=JointStart, held=("angle", "spin"))
