"""Checks of single options: names, numbers and pressures, with errors that say how to fix them.

Option values as plain Python: numbers of NumPy, arrays, ranges and paths survive JSON then.

Signature of a user's reward function, and its check.
"""

import difflib
import inspect
import numbers
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from enum import Enum
from pathlib import PurePath
from typing import Any, Protocol, TypeGuard

import numpy as np

from pma_gym.plant.model import Model
from pma_gym.tasks import OPERATOR_BOUNDS, Operator

SEQUENCES = ("pressure_kpa", "pressures_kpa", "reference")
"""Options that may be a sequence: any iterable is taken as a list."""


def plain_options(given: Mapping[str, Any]) -> dict[str, Any]:
    """Keyword arguments of an environment with plain Python values, which JSON can hold.

    What has no plain form (a Model, a Task, a function) and what is no valid value stays, for the
    check of that option to accept or to quote.

    >>> plain_options({"preview": np.int64(2), "pressure_kpa": range(200, 301, 50), "noise": True})
    {'preview': 2, 'pressure_kpa': [200, 250, 300], 'noise': True}
    """
    return {
        name: plain_sequence(value) if name in SEQUENCES else plain_scalar(value)
        for name, value in given.items()
    }


def plain_scalar(value: Any) -> Any:  # noqa: ANN401
    """A number, truth, text, path or member of an enumeration as Python's own; others unchanged.

    A NumPy array without dimensions is the number in it. A truth never becomes a number.
    """
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, str):
        return str(value)
    if isinstance(value, PurePath):
        return str(value)
    if isinstance(value, numbers.Integral):
        return int(value)
    return float(value) if isinstance(value, numbers.Real) else value


def plain_sequence(value: Any) -> Any:  # noqa: ANN401
    """An iterable as a list of plain values, rows of a table as lists in it; others as scalars.

    A mapping and a set are no sequences: they have no order of numbers to draw from. Nor is an
    iterator, which is empty once it was read.
    """
    scalar = plain_scalar(value)
    if not isinstance(scalar, Iterable) or isinstance(
        scalar, str | bytes | Iterator | Mapping | Set
    ):
        return scalar
    return [plain_sequence(one) for one in scalar]


Pressure = float | Sequence[float] | str
"""Gauge pressure of the episodes (kPa): one, several to draw from, or "random"."""


def check_known(what: str, given: Iterable[str], known: Sequence[str]) -> None:
    """Reject unknown names.

    Raises:
        TypeError: the first unknown name, the nearest known one, and all known.
    """
    for name in given:
        if name not in known:
            raise TypeError(
                f"unknown {what} {name!r}{_nearest(name, known)}; known: {', '.join(known)}"
            )


def check_keywords(
    caller: str, given: Iterable[str], known: Sequence[str], others: Sequence[str] = ()
) -> None:
    """Reject unknown keyword arguments with the wording of Python's own message.

    Libraries look for this wording to find out whether an environment accepts an argument.

    Args:
        caller: name of the called function or class.
        given: names given.
        known: names of the options.
        others: names of further keyword arguments of the caller.
    Raises:
        TypeError: the first unknown name, the nearest known one, and all known.
    """
    for name in given:
        if name not in known:
            raise TypeError(
                f"{caller} got an unexpected keyword argument {name!r}"
                f"{_nearest(name, [*known, *others])}; known: {', '.join([*known, *others])}"
            )


def check_named(what: str, value: object, known: Iterable[str]) -> None:
    """Reject a value that is not a known name.

    Raises:
        ValueError: with the known names, the value and the nearest known name.
    """
    names = list(known)
    if not isinstance(value, str) or value not in names:
        raise unknown_name(what, value, names)


def check_operator(operator: Operator) -> None:
    """Reject an operator with a parameter out of range.

    Raises:
        ValueError: with the parameter, its range and unit, and its value.
    """
    for name, value in operator._asdict().items():
        lower, upper, unit = OPERATOR_BOUNDS[name]
        check_number(f"operator.{name}", value, lower, upper, unit)


def check_pressure(pressure: object, model: Model | None = None) -> None:
    """Reject what is no pressure, and one outside the validity of a model.

    Raises:
        ValueError: with the range, the unit and the value.
    """
    if isinstance(pressure, str) and pressure == "random":
        return
    several = pressure if isinstance(pressure, list | tuple) else [pressure]
    if not several or not all(map(is_real, several)):
        raise ValueError(
            f'pressure_kpa must be a number in kPa, a list of numbers or "random", got {pressure!r}'
        )
    if model is None:
        return
    valid = model.parameters["validity"]
    unit = f"kPa ([validity] of model {model.name})"
    for one in several:
        check_number("pressure_kpa", one, 1e-3 * valid.lowest, 1e-3 * valid.highest, unit)


def parse_pressure(given: object, model: Model) -> Pressure:
    """Check the pressure of episodes and return it as plain Python values.

    Raises:
        ValueError: with the range, the unit and the value.
    """
    pressure = plain_sequence(given)
    check_pressure(pressure, model)
    return pressure


def parse_pressures(given: object, count: int, model: Model) -> list[Pressure]:
    """Check one pressure per environment and return them as plain Python values.

    Raises:
        ValueError: with the rule and the value.
    """
    pressures = plain_sequence(given)
    length = f"{len(pressures)}" if isinstance(pressures, list) else "no sequence"
    if length != f"{count}":
        raise ValueError(
            f"pressures_kpa must hold one pressure for each of the {count} environments, got "
            f"{length}: {given!r}; pressure_kpa is one for all"
        )
    for pressure in pressures:
        check_pressure(pressure, model)
    return pressures


def check_count(name: str, count: object, most: int) -> None:
    """Reject an invalid number of things.

    Raises:
        ValueError: with the name, the rule and the value.
    """
    if not is_whole(count) or not 1 <= count <= most:
        raise ValueError(f"{name} must be a whole number in 1-{most}, got {count!r}")


def check_whole(name: str, value: object) -> None:
    """Reject a value that is not a whole number of control steps in 0-1000.

    Raises:
        ValueError: with the option, the rule and the value.
    """
    if not is_whole(value) or not 0 <= value <= 1000:
        raise ValueError(f"{name} must be a whole number of control steps in 0-1000, got {value!r}")


def check_number(name: str, value: object, lower: float, upper: float, unit: str) -> None:
    """Reject a value that is not a number within a range.

    Raises:
        ValueError: with the option, its range and unit, and the value.
    """
    # `not <=`: NaN is out of every range.
    if not is_real(value) or not lower <= value <= upper:
        raise ValueError(f"{name} must be a number in {lower:g}-{upper:g} {unit}, got {value!r}")


def is_real(value: object) -> TypeGuard[float]:
    """Whether a value is a real number; True and False are not."""
    return isinstance(value, numbers.Real) and not isinstance(value, bool)


def is_whole(value: object) -> TypeGuard[int]:
    """Whether a value is a whole number; True and False are not."""
    return isinstance(value, numbers.Integral) and not isinstance(value, bool)


def unknown_name(what: str, value: object, names: Sequence[str]) -> ValueError:
    """Return the error for an unknown name, with the nearest known one."""
    return ValueError(
        f"{what} must be one of {', '.join(names)}, got {value!r}{_nearest(value, names)}"
    )


def _nearest(name: object, known: Sequence[str]) -> str:
    close = difflib.get_close_matches(str(name).lower(), known, n=1, cutoff=0.5)
    return f" (did you mean {close[0]!r}?)" if close else ""


class RewardFunction(Protocol):
    """Reward of a step: a function of four floats that returns a finite number.

    The arguments are positional, in this order:

    - the true error at the step's end, in percent of the task's range;
    - the largest change of an entry of the action (-1 to 1) since the step before;
    - the true position at the step's end, in the unit of the info (mm, deg or N m);
    - its reference then, in the same unit.
    """

    def __call__(
        self, error_percent: float, action_change: float, position: float, reference: float, /
    ) -> float:
        """The reward."""
        ...


RULE = (
    "a function of four numbers (error in percent of the range, change of the action, position, "
    "reference) that returns a finite number"
)


def check_reward_function(reward: Callable[..., object]) -> None:
    """Reject a value that cannot be called with four numbers.

    Raises:
        ValueError: with the rule and the value.
    """
    try:
        signature = inspect.signature(reward)
    except (TypeError, ValueError):
        # A builtin may not say what it takes: its first call will.
        return
    try:
        signature.bind(0.0, 0.0, 0.0, 0.0)
    except TypeError as problem:
        raise ValueError(
            f"reward must be a name or {RULE}, got {reward!r}: {problem}; "
            "def reward(error_percent, action_change, position, reference): ..."
        ) from None
