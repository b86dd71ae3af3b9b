"""Residual laws of free shape: straight lines between nine or seventeen values.

They are no physical phenomena. A diagnosis fits them where no effect of the catalogue explains the
data: they give the missing force, torque, damping or load as a function of position, speed,
pressure or load. A model with such a law can be simulated although the cause is unknown.
"""

from collections import namedtuple
from collections.abc import Callable
from typing import Annotated, Any

from pma_gym.effects.arithmetic import clip, maximum
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

HEIGHTS = 9
"""Number of values of a law, equally spaced."""

FREE_LAW = "free law"
"""What `Effect.replaces` says of such a law."""

_FORCE = Quantity("N", -1e6, 1e6, "fitted, whatever it is", 0.0, usual=5.0)
_TORQUE = Quantity("N m", -1e6, 1e6, "fitted, whatever it is", 0.0, usual=0.5)
_DAMPING = Quantity("N s/mm", -1e6, 1e6, "fitted, whatever it is", 0.0, usual=0.02)
_TURNING = Quantity("N m s", -1e6, 1e6, "fitted, whatever it is", 0.0, usual=0.01)


def _parameters(
    name: str,
    unit: str,
    least: float,
    most: float,
    usual: tuple[float, float],
    height: Quantity = _FORCE,
    halves: bool = False,
) -> Any:  # noqa: ANN401
    """Make a NamedTuple of the first argument, the range of arguments and the values.

    Of `halves`, with what a law over a place has more half way between two values: a detent.
    """
    ends = {
        "first": Quantity(unit, least, most, "where the data begin", usual=usual[0]),
        "reach": Quantity(unit, 1e-6, most - least, "how far they go from there", usual=usual[1]),
    }
    fields = ends | {f"h{k}": height for k in range(HEIGHTS)}
    fields |= {f"m{k}": height for k in range(HEIGHTS - 1)} if halves else {}
    tuple_class = namedtuple(name, fields)
    tuple_class.__annotations__ = {stem: Annotated[float, each] for stem, each in fields.items()}
    return tuple_class


ForceOfContraction = _parameters("ForceOfContraction", "mm", -50, 200, (-10, 70))
ForceOfPosition = _parameters("ForceOfPosition", "mm", -1e6, 1e6, (-50, 100), halves=True)
ForceOfVelocity = _parameters("ForceOfVelocity", "mm/s", -1e6, 1e6, (-50, 100))
TorqueOfAngle = _parameters("TorqueOfAngle", "deg", -1e7, 1e7, (-90, 180), _TORQUE, True)
DampingOfPosition = _parameters("DampingOfPosition", "mm", -1e6, 1e6, (-50, 100), _DAMPING, True)
DampingOfAngle = _parameters("DampingOfAngle", "deg", -1e7, 1e7, (-90, 180), _TURNING, True)
TorqueOfSpeed = _parameters("TorqueOfSpeed", "deg/s", -1e6, 1e6, (-90, 180), _TORQUE)
ForceOfPressure = _parameters("ForceOfPressure", "kPa", -100, 2000, (150, 425))
LoadOfLoad = _parameters("LoadOfLoad", "N", -100, 5000, (0, 1000))


def between_heights(value, p):
    """Interpolate linearly between the law's values; constant beyond the ends.

    Args:
        value: argument of the law (SI).
        p: first, reach: argument of the first value and range of the arguments; h0 ... h8: values;
            m0 ... m7, if any: what is added half way between two of them.
    Returns:
        Value of the law, in the unit of h0 (SI).
    """
    first, reach, *values = p
    place = (value - first) * (8.0 / reach)
    heights, halves = values[:HEIGHTS], values[HEIGHTS:]
    height = heights[0]
    for k in range(len(heights) - 1):
        height = height + clip(place - k, 0.0, 1.0) * (heights[k + 1] - heights[k])
    for k, more in enumerate(halves):
        height = height + maximum(0.0, 1.0 - abs(2.0 * (place - k) - 1.0)) * more
    return height


def force_of_contraction(contraction, p):
    """Missing force on the slide as a function of contraction (N); positive shortens the muscle.

    Args:
        contraction: shortening x from the resting length (m).
        p: ForceOfContraction or ForceOfPosition.
    Returns:
        Force (N).
    Source:
        None: fitted.
    """
    return between_heights(contraction, p)


def torque_of_angle(angle, p):
    """Missing torque on the joint as a function of the angle (N m); positive as the angle grows.

    Args:
        angle: of the joint (rad).
        p: TorqueOfAngle.
    Returns:
        Torque (N m).
    Source:
        None: fitted.
    """
    return between_heights(angle, p)


def force_of_velocity(velocity, p):
    """Missing force, or torque, as a function of speed; positive as the position grows.

    Args:
        velocity: rate of contraction x' (m/s), or of the angle (rad/s).
        p: ForceOfVelocity or TorqueOfSpeed.
    Returns:
        Force (N, N m).
    Source:
        None: fitted.
    """
    return between_heights(velocity, p)


def damping_of_contraction(contraction, velocity, p):
    """Missing force on the slide of a damping that depends on the contraction (N).

    Args:
        contraction: shortening x (m).
        velocity: rate of contraction x' (m/s).
        p: DampingOfPosition.
    Returns:
        Force (N).
    Source:
        None: fitted.
    """
    return -velocity * between_heights(contraction, p)


def damping_of_angle(angle, spin, p):
    """Missing torque on the joint of a damping that depends on the angle (N m).

    Args:
        angle: of the joint (rad).
        spin: its rate (rad/s).
        p: DampingOfAngle.
    Returns:
        Torque (N m).
    Source:
        None: fitted.
    """
    return -spin * between_heights(angle, p)


def force_of_pressure(pressure, p):
    """Missing force on the slide as a function of pressure (N); positive shortens the muscle.

    Args:
        pressure: gauge pressure P (Pa).
        p: ForceOfPressure.
    Returns:
        Force (N).
    Source:
        None: fitted.
    """
    return between_heights(pressure, p)


def load_of_load(load, p):
    """Load that the drive commands, corrected by the missing load.

    Args:
        load: load that the drive would command without the correction (N).
        p: LoadOfLoad.
    Returns:
        Load (N).
    Source:
        None: fitted.
    """
    return load + between_heights(load, p)


_SIGNATURE = "none of its own; drawn by a diagnosis where no other effect fits"


def _effect(name: str, port: str, parameters: type, law: Callable) -> Effect:
    return Effect(
        name,
        port,
        parameters,
        law,
        signature=_SIGNATURE,
        held=("first", "reach"),
        replaces=FREE_LAW,
    )


RESIDUAL_FORCE_OF_CONTRACTION = _effect(
    "residual_force_of_contraction", "muscle_force", ForceOfContraction, force_of_contraction
)
RESIDUAL_FORCE_OF_VELOCITY = _effect(
    "residual_force_of_velocity", "slide_force", ForceOfVelocity, force_of_velocity
)
RESIDUAL_FORCE_OF_POSITION = _effect(
    "residual_force_of_position", "slide_force", ForceOfPosition, force_of_contraction
)
RESIDUAL_DAMPING_OF_POSITION = _effect(
    "residual_damping_of_position", "slide_force", DampingOfPosition, damping_of_contraction
)
RESIDUAL_DAMPING_OF_ANGLE = _effect(
    "residual_damping_of_angle", "joint_torque", DampingOfAngle, damping_of_angle
)
RESIDUAL_TORQUE_OF_ANGLE = _effect(
    "residual_torque_of_angle", "joint_torque", TorqueOfAngle, torque_of_angle
)
RESIDUAL_TORQUE_OF_SPEED = _effect(
    "residual_torque_of_speed", "joint_torque", TorqueOfSpeed, force_of_velocity
)
RESIDUAL_FORCE_OF_PRESSURE = _effect(
    "residual_force_of_pressure", "muscle_force", ForceOfPressure, force_of_pressure
)
RESIDUAL_LOAD = _effect("residual_load", "drive_shape", LoadOfLoad, load_of_load)
