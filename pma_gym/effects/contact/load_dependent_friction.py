"""Dry friction that grows with the transmitted force: gears, worms, screws."""

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
        float, Quantity("um", 0.0001, 20000, "assumption: 10 um at full force", usual=10)
    ]


class JointLoadFriction(NamedTuple):
    """Parameters of `load_friction` about an axis."""

    drive_share: Annotated[float, _SHARE]
    carried_share: Annotated[float, _SHARE]
    presliding: Annotated[
        float, Quantity("deg", 1e-5, 10, "assumption: 0.02 at full torque", usual=0.02)
    ]


def load_friction(drive_force, carried_force, memory, p):
    """Friction force of the bristles, proportional to the forces on both sides of a gear.

        F = -(drive_share |F_drive| + carried_share |F_carried|) z

    Args:
        drive_force: force or torque of the drive F_drive (N, N m).
        carried_force: force or torque that the rig carries F_carried: weight, springs and
            constant forces (N, N m).
        memory: deflection z of the bristles, between -1 and 1; see `friction_path`.
        p: LoadDependentFriction or JointLoadFriction: drive_share, carried_share, presliding
            (m, rad).
    Returns:
        Force (N, N m), against the motion.
    Source:
        Coulomb's law for the teeth of a gear, with a share of the force on each side as in the
        friction models of Rhoban's bam. Friction without a load is a separate dry friction.
    """
    level = p.drive_share * abs(drive_force) + p.carried_share * abs(carried_force)
    return -level * memory


def load_friction_bend(memory, direction, p):
    """Distance to the point where the bristles begin to slip, or to where all of them slip.

    Args:
        memory: z where the travel begins.
        direction: 1 where the motion is forwards, else -1.
        p: parameters with drive_share, carried_share and presliding (m, rad).
    Returns:
        Distance (m, rad), 0 where all bristles slip or there is no friction.
    """
    return where(p.drive_share + p.carried_share > 0.0, p.presliding, 0.0) * elastic_way(
        memory, direction
    )


def load_breakpoints(drive_force, carried_force, p):
    """Signals at whose zeros the slope of the level jumps: the forces on both sides of the gear.

    Args:
        drive_force: force or torque of the drive (N, N m).
        carried_force: force or torque that the rig carries (N, N m).
        p: LoadDependentFriction or JointLoadFriction: drive_share, carried_share.
    Returns:
        Both forces; 1 in place of one that has no share.
    """
    drives = where(p.drive_share > 0.0, 1.0, 0.0)
    carries = where(p.carried_share > 0.0, 1.0, 0.0)
    return drives * drive_force + (1.0 - drives), carries * carried_force + (1.0 - carries)


_SIGNATURE = "odd step of force where the motion turns, in proportion to the force of the drive"

LOAD_DEPENDENT_FRICTION = Effect(
    name="load_dependent_friction",
    port="drive_loss",
    parameters=LoadDependentFriction,
    law=load_friction,
    rate_independent_law=friction_path,
    path_breakpoint=load_friction_bend,
    breakpoint=load_breakpoints,
    release_path=release_path,
    held=("presliding",),
    scanned=("presliding",),
    terms=(("carried_share",),),
    signature=_SIGNATURE,
)
JOINT_LOAD_FRICTION = Effect(
    name="joint_load_friction",
    port="joint_drive_loss",
    parameters=JointLoadFriction,
    law=load_friction,
    rate_independent_law=friction_path,
    path_breakpoint=load_friction_bend,
    breakpoint=load_breakpoints,
    release_path=release_path,
    held=("presliding",),
    scanned=("presliding",),
    terms=(("carried_share",),),
    signature=_SIGNATURE,
)
