"""What breaks the rig."""

from collections.abc import Mapping
from typing import Any

from pma_gym.kernels.generic import where
from pma_gym.plant.model import Model

LIMITS: tuple[tuple[str, str, float], ...] = (
    ("contraction", "contraction", 1.0),
    ("contraction", "stretch", -1.0),
    ("load", "tension", 1.0),
    ("pressure", "pressure", 1.0),
)
"""What breaks the rig: output, the field of `[limits]` that bounds it, and its sign."""


def broken(limits: Any, truth: Mapping[str, Any]) -> Any:  # noqa: ANN401
    """Which of `LIMITS` a state breaks, counted from 1; 0.0 for none. Numbers or traced values.

    Args:
        limits: the rig's parameters of `[limits]` (SI).
        truth: contraction (m), load (N), pressure (Pa).
    """
    found = 0.0
    # A state that is no number keeps no limit. The first of several counts.
    for i, (output, limit, sign) in reversed(list(enumerate(LIMITS, 1))):
        found = where(sign * truth[output] <= getattr(limits, limit), found, float(i))
    return found


def broken_limit(model: Model, truth: Mapping[str, float]) -> str | None:
    """Which physical limit of the rig a state breaks, in words; None if none.

    Args:
        model: the rig's model, with its limits.
        truth: contraction (m), load (N), pressure (Pa).
    """
    return limit_in_words(model, broken(model.parameters["limits"], truth))


def limit_in_words(model: Model, code: float) -> str | None:
    """The limit of `LIMITS` that `broken` found, in words; None for 0."""
    limits = model.parameters["limits"]
    words = (
        "",
        f"contraction above {limits.contraction * 1e3:g} mm",
        f"muscle stretched over {limits.stretch * 1e3:g} mm beyond its resting length",
        f"cable tension above {limits.tension:g} N",
        f"pressure above {limits.pressure / 1e3:g} kPa",
    )
    return words[int(code)] or None
