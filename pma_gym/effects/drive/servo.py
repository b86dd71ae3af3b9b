"""The servo motor of the dissertation's linear model, without and with inertia."""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

_TABLE_3 = "Serres 2008, table 3"


class Servo(NamedTuple):
    """Stiffness and damping of the motor's position loop, and its pulley."""

    stiffness: Annotated[float, Quantity("N m", 1e-3, 1e4, f"{_TABLE_3}: 10.26", usual=10.26)]
    damping: Annotated[float, Quantity("N m s", 1e-7, 1e3, f"{_TABLE_3}: 7.64e-4", usual=0.000764)]
    radius: Annotated[
        float,
        Quantity(
            "mm", 1, 500, "Serres 2008, tables I13-I20: 45 mm for 90 deg is 28.65", usual=28.65
        ),
    ]


class ServoInertia(NamedTuple):
    """Inertia and damping ratio of the motor's position loop."""

    inertia: Annotated[float, Quantity("kg m^2", 1e-9, 1, "assumption: 2.0e-3", usual=0.002)]
    damping_ratio: Annotated[
        float,
        Quantity(
            "1", 0.001, 10, "assumption: 0.7; the printed damping alone gives 0.003", usual=0.7
        ),
    ]


def servo_rate(displacement_input, p):
    """Rate of the motor's displacement without inertia: u' = (K_M / B_M) (x_in - u).

    Args:
        displacement_input: x_in (m).
        p: Servo: stiffness K_M (N m), damping B_M (N m s).
    Returns:
        (source, decay) with u' = source - decay * u. The integrator solves this fast pole
        (13 428 1/s) exactly.
    Source:
        Serres 2008, Eq. 11-15.
    """
    decay = p.stiffness / p.damping
    return decay * displacement_input, decay


def servo_acceleration(displacement_input, displacement, displacement_rate, servo, p):
    """Acceleration of the motor's displacement with inertia.

        J u'' + 2 zeta sqrt(K_M J) u' + K_M u = K_M x_in

    Args:
        displacement_input: x_in (m).
        displacement: u (m).
        displacement_rate: u' (m/s).
        servo: Servo.
        p: ServoInertia: inertia J (kg m^2), damping_ratio zeta.
    Returns:
        u'' (m/s^2).
    Source:
        Serres 2008, Eq. 10; the damping ratio replaces the printed damping, which would ring
        for seconds.
    """
    square = servo.stiffness / p.inertia
    return square * (displacement_input - displacement) - (
        2.0 * p.damping_ratio * square**0.5 * displacement_rate
    )


SERVO = Effect("servo", "servo", Servo, servo_rate)
SERVO_INERTIA = Effect("servo_inertia", "servo_inertia", ServoInertia, servo_acceleration)
