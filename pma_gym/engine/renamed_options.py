"""Earlier names of environment options, which users' scripts, policies and suites may contain."""

import warnings
from collections.abc import Mapping
from typing import Any

RENAMED_OPTIONS: Mapping[str, str] = {"human": "operator"}
"""Present names of options, keyed by earlier ones."""

RENAMED_VALUES: Mapping[str, Mapping[str, str]] = {
    "disturbances": {
        "operator": "hand_push",
        "regulator_and_operator": "regulator_and_hand_push",
    },
}
"""Present values keyed by earlier ones, by the option's present name."""


def renamed_options(given: Mapping[str, Any], what: str, stacklevel: int = 2) -> dict[str, Any]:
    """Replace earlier names and values of options, in order, with one warning if there are any.

    Args:
        given: names and values.
        what: owner of the options, for the message.
        stacklevel: as `warnings.warn` counts it from the caller.
    Raises:
        TypeError: both names of an option are given.

    Example:
        >>> renamed_options({"operator": "typical", "noise": False}, "the environment")
        {'operator': 'typical', 'noise': False}
    """
    new: dict[str, Any] = {}
    for name, value in given.items():
        now = RENAMED_OPTIONS.get(name, name)
        if now != name and now in given:
            raise TypeError(f"{what} got {now} and {name}, its old name; give {now} alone")
        values = RENAMED_VALUES.get(now, {})
        new[now] = values.get(value, value) if isinstance(value, str) else value
    changed = [
        f"{old}={given[old]!r} is now {now}={new[now]!r}"
        for old, now in zip(given, new, strict=True)
        if old != now or given[old] is not new[now]
    ]
    if changed:
        warnings.warn(f"{what}: {', '.join(changed)}", DeprecationWarning, stacklevel + 1)
    return new


def first_names(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options by the names that digests were first made of; they outlive a renaming.

    >>> first_names({"operator": "random", "disturbances": "hand_push"})
    {'human': 'random', 'disturbances': 'operator'}
    """
    names = {new: old for old, new in RENAMED_OPTIONS.items()}
    values = {
        option: {new: old for old, new in renamed.items()}
        for option, renamed in RENAMED_VALUES.items()
    }
    return {
        names.get(name, name): values.get(name, {}).get(value, value)
        if isinstance(value, str)
        else value
        for name, value in options.items()
    }
