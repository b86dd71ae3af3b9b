"""Physical limits of the rig, and safety limits of an exercise."""

from collections.abc import Mapping
from typing import Any

from pma_gym.codegen.generic import where
from pma_gym.plant.model import Model
from pma_gym.tasks.exercise import Exercise
from pma_gym.units import SI_FACTORS

LIMITS: tuple[tuple[str, str, float], ...] = (
    ("contraction", "contraction", 1.0),
    ("contraction", "stretch", -1.0),
    ("load", "tension", 1.0),
    ("pressure", "pressure", 1.0),
)
"""Physical limits of the rig: output, the field of `[limits]` that bounds it, and its sign."""


def broken(limits: Any, truth: Mapping[str, Any]) -> Any:  # noqa: ANN401
    """Index (from 1) of the first of `LIMITS` that a state exceeds, else 0.0; numbers or traced.

    Args:
        limits: the rig's parameters of `[limits]` (SI).
        truth: contraction (m), load (N), pressure (Pa).
    """
    code = 0.0
    # A state that is no number keeps no limit. The first of several counts.
    for i, (output, limit, sign) in reversed(list(enumerate(LIMITS, 1))):
        code = where(sign * truth[output] <= getattr(limits, limit), code, float(i))
    return code


def unsafe(exercise: Exercise, moment: Any, speed: Any) -> Any:  # noqa: ANN401
    """Code of the safety limit that an exercise exceeds, counted on from `LIMITS`; 0.0 for none.

    Args:
        exercise: with its safe moment and speed.
        moment: at the joint (N m), a number or a traced value.
        speed: of the joint (rad/s).
    """
    code = float(len(LIMITS))
    # A joint that turns at no speed that is a number is not safe.
    speed_code = where(abs(speed) <= exercise.safe_speed, 0.0, code + 2.0)
    return where(moment <= exercise.safe_moment, speed_code, code + 1.0)


def broken_limit(model: Model, truth: Mapping[str, float]) -> str:
    """Name the physical limit of the rig that a state exceeds; "" if none.

    Args:
        model: the rig's model, with its limits.
        truth: contraction (m), load (N), pressure (Pa).
    """
    return limit_in_words(model, broken(model.parameters["limits"], truth))


def limit_in_words(model: Model, code: float, exercise: Exercise | None = None) -> str:
    """Name the limit that `broken` or `unsafe` returned; "" for 0."""
    if not code:
        return ""
    limits = model.parameters["limits"]
    words = (
        f"contraction above {limits.contraction * 1e3:g} mm",
        f"muscle stretched over {limits.stretch * 1e3:g} mm beyond its resting length",
        f"cable tension above {limits.tension:g} N",
        f"pressure above {limits.pressure / 1e3:g} kPa",
    )
    if exercise:
        speed = exercise.safe_speed / SI_FACTORS["deg"]
        words += (
            f"moment at the joint above the safe {exercise.safe_moment:g} N m",
            f"joint faster than the safe {speed:g} deg/s",
        )
    return words[int(code) - 1]
