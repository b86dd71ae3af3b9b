"""Motors of a joint: a torque-controlled drive, or a DC motor at a voltage."""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class TorqueDrive(NamedTuple):
    """Parameters of `drive_torque`."""

    gain: Annotated[float, Quantity("1", 1e-3, 1e3, "1: it gives what it is asked for", usual=1.0)]


def drive_torque(command, p):
    """Torque of a torque-controlled drive: T = gain T_command.

    Args:
        command: commanded torque T_command (N m).
        p: TorqueDrive: gain.
    Returns:
        Torque (N m); positive in the direction in which the angle grows.
    Source:
        Assumption: the current loop is much faster than the mechanics.
    """
    return p.gain * command


class DcMotor(NamedTuple):
    """Parameters of `motor_torque`."""

    torque_constant: Annotated[
        float, Quantity("N m/A", 1e-6, 1e3, "assumption: 0.1, at the joint", usual=0.1)
    ]
    resistance: Annotated[float, Quantity("ohm", 1e-4, 1e5, "assumption: 4", usual=4.0)]


def motor_torque(command, spin, p):
    """Torque of a DC motor at a voltage, without the inductance of its winding.

        T = kt / R (U - kt w)

    Args:
        command: voltage U at the winding (V).
        spin: speed of the joint w (rad/s).
        p: DcMotor: torque_constant kt (N m/A, as well V s/rad), resistance R (ohm).
    Returns:
        Torque (N m); positive in the direction in which the angle grows.
    Source:
        Textbooks on direct-current motors: in SI, torque and back-EMF constant are equal.
    """
    return p.torque_constant / p.resistance * (command - p.torque_constant * spin)


TORQUE_DRIVE = Effect(
    name="torque_drive",
    port="joint_drive",
    parameters=TorqueDrive,
    # A motion tells its ratio to the inertia alone.
    held=("gain",),
    law=drive_torque,
    signature="angular acceleration in proportion to the torque that is asked for",
)
DC_MOTOR = Effect(
    name="dc_motor",
    port="joint_drive",
    parameters=DcMotor,
    held=("resistance",),
    law=motor_torque,
    signature="angular acceleration in proportion to the voltage, less at speed (back-EMF)",
)
