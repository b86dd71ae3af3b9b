"""Residual laws of free shape: straight lines between nine values.

They are no physical phenomena. A diagnosis fits them where no effect of the catalogue explains the
data: they give the missing force, or load, as a function of contraction, speed, pressure or load.
A model with such a law can be simulated although the cause is unknown.
"""

from collections import namedtuple
from collections.abc import Callable
from typing import Annotated, Any

from pma_gym.effects.arithmetic import clip
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

HEIGHTS = 9
"""Number of values of a law, equally spaced."""

_HEIGHT = Quantity("N", -500, 500, "fitted, whatever it is", 0.0, usual=5.0)


def _parameters(name: str, unit: str, least: float, most: float, usual: tuple[float, float]) -> Any:  # noqa: ANN401
    """Make a NamedTuple of the first argument, the range of arguments and the values."""
    ends = {
        "first": Quantity(unit, least, most, "where the data begin", usual=usual[0]),
        "reach": Quantity(unit, 1.0, most - least, "how far they go from there", usual=usual[1]),
    }
    fields = ends | {f"h{k}": _HEIGHT for k in range(HEIGHTS)}
    tuple_class = namedtuple(name, fields)
    tuple_class.__annotations__ = {stem: Annotated[float, each] for stem, each in fields.items()}
    return tuple_class


ForceOfContraction = _parameters("ForceOfContraction", "mm", -50, 200, (-10, 70))
ForceOfVelocity = _parameters("ForceOfVelocity", "mm/s", -2000, 2000, (-50, 100))
ForceOfPressure = _parameters("ForceOfPressure", "kPa", -100, 2000, (150, 425))
LoadOfLoad = _parameters("LoadOfLoad", "N", -100, 5000, (0, 1000))


def between_heights(value, p):
    """Interpolate linearly between the law's values; constant beyond the ends.

    Args:
        value: argument of the law (SI).
        p: first, reach: argument of the first value and range of the arguments; h0 ... h8: values.
    Returns:
        Value of the law, in the unit of h0 (SI).
    """
    place = (value - p.first) * (8.0 / p.reach)
    heights = (p.h0, p.h1, p.h2, p.h3, p.h4, p.h5, p.h6, p.h7, p.h8)
    height = heights[0]
    for k in range(len(heights) - 1):
        height = height + clip(place - k, 0.0, 1.0) * (heights[k + 1] - heights[k])
    return height


def force_of_contraction(contraction, p):
    """Missing force on the slide as a function of contraction (N); positive shortens the muscle.

    Args:
        contraction: shortening x from the resting length (m).
        p: ForceOfContraction.
    Returns:
        Force (N).
    Source:
        None: fitted.
    """
    return between_heights(contraction, p)


def force_of_velocity(velocity, p):
    """Missing force on the slide as a function of speed (N); positive shortens the muscle.

    Args:
        velocity: rate of contraction x' (m/s).
        p: ForceOfVelocity.
    Returns:
        Force (N).
    Source:
        None: fitted.
    """
    return between_heights(velocity, p)


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
        replaces="free law",
    )


RESIDUAL_FORCE_OF_CONTRACTION = _effect(
    "residual_force_of_contraction", "muscle_force", ForceOfContraction, force_of_contraction
)
RESIDUAL_FORCE_OF_VELOCITY = _effect(
    "residual_force_of_velocity", "slide_force", ForceOfVelocity, force_of_velocity
)
RESIDUAL_FORCE_OF_PRESSURE = _effect(
    "residual_force_of_pressure", "muscle_force", ForceOfPressure, force_of_pressure
)
RESIDUAL_LOAD = _effect("residual_load", "drive_shape", LoadOfLoad, load_of_load)
