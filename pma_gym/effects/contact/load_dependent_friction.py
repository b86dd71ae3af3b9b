"""Dry friction that grows with the force of the drive: gears, worms, screws."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import where
from pma_gym.effects.effect import Effect
from pma_gym.effects.slide.coulomb_friction import elastic_way, friction_path, release_path
from pma_gym.units import Quantity

_SHARE = Quantity(
    "%", 0, 100, "assumption: 10, a train of spur gears loses 2 a stage", 0.0, usual=10
)


class LoadDependentFriction(NamedTuple):
    """Parameters of `load_friction` along a line."""

    drive_share: Annotated[float, _SHARE]
    carried_share: Annotated[float, _SHARE]
    presliding: Annotated[
        float, Quantity("um", 0.1, 20000, "assumption: 10 um at full force", usual=10)
    ]


class JointLoadFriction(NamedTuple):
    """Parameters of `load_friction` about an axis."""

    drive_share: Annotated[float, _SHARE]
    carried_share: Annotated[float, _SHARE]
    presliding: Annotated[
        float, Quantity("deg", 1e-5, 10, "assumption: 0.02 at full torque", usual=0.02)
    ]


def load_friction(drive_force, carried_force, memory, p):
    """Force of the bristles, in proportion to what presses the teeth on both sides of the gears.

        F = -(drive_share |F_drive| + carried_share |F_carried|) z

    Args:
        drive_force: force or torque of the drive F_drive (N, N m).
        carried_force: force or torque that the rig carries F_carried, of weight, springs and what
            is constant (N, N m).
        memory: deflection z of the bristles, between -1 and 1; see `friction_path`.
        p: LoadDependentFriction or JointLoadFriction: drive_share, carried_share, presliding
            (m, rad).
    Returns:
        Force (N, N m), against the motion.
    Source:
        Coulomb's law for teeth that both sides press on each other, a share of each side as in the
        friction models of Rhoban's bam; what rubs without a load is dry friction beside it.
    """
    level = p.drive_share * abs(drive_force) + p.carried_share * abs(carried_force)
    return -level * memory


def load_friction_bend(memory, direction, p):
    """Way to where the deflection begins to bend over, or to where all bristles slip.

    Args:
        memory: z where the travel begins.
        direction: 1 where the motion is forwards, else -1.
        p: parameters with drive_share, carried_share and presliding (m, rad).
    Returns:
        Way (m, rad), 0 where all slip or nothing rubs.
    """
    return where(p.drive_share + p.carried_share > 0.0, p.presliding, 0.0) * elastic_way(
        memory, direction
    )


_SIGNATURE = "odd step of force where the motion turns, in proportion to the force of the drive"

LOAD_DEPENDENT_FRICTION = Effect(
    name="load_dependent_friction",
    port="drive_loss",
    parameters=LoadDependentFriction,
    law=load_friction,
    rate_independent_law=friction_path,
    path_breakpoint=load_friction_bend,
    release_path=release_path,
    held=("presliding",),
    signature=_SIGNATURE,
)
JOINT_LOAD_FRICTION = Effect(
    name="joint_load_friction",
    port="joint_drive_loss",
    parameters=JointLoadFriction,
    law=load_friction,
    rate_independent_law=friction_path,
    path_breakpoint=load_friction_bend,
    release_path=release_path,
    held=("presliding",),
    signature=_SIGNATURE,
)
