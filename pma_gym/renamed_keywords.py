"""Old names of keyword arguments: they work, with a warning that names the new one.

Users' scripts and effect files name arguments. An old name stands beside the function or class that
takes it, and nowhere else.
"""

import functools
import warnings
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

Target = TypeVar("Target", bound=Callable)


def old_keywords(
    renamed: Mapping[str, str], values: Mapping[str, Mapping[Any, Any]] | None = None
) -> Callable[[Target], Target]:
    """Accept old names of keyword arguments of a function or class.

    Args:
        renamed: new names by old ones.
        values: new values by old ones, of the arguments (old names) whose values changed as well.
    Returns:
        A decorator. What it decorates raises TypeError if an argument comes by both names.

    Example:
        >>> @old_keywords({"colour": "color"})
        ... def paint(color):
        ...     return color
        >>> paint(color="red")
        'red'
    """

    def new_arguments(name: str, given: dict[str, Any]) -> dict[str, Any]:
        for old in [key for key in given if key in renamed]:
            new = renamed[old]
            if new in given:
                raise TypeError(f"{name}() got {new} and {old}, its old name; give {new} alone")
            value = given.pop(old)
            given[new] = (values or {}).get(old, {}).get(value, value)
            warnings.warn(
                f"{name}({old}={value!r}) is now {name}({new}={given[new]!r})",
                DeprecationWarning,
                stacklevel=3,
            )
        return given

    def decorate(target: Target) -> Target:
        function = target.__init__ if isinstance(target, type) else target

        @functools.wraps(function)
        def call(*args: Any, **kwargs: Any) -> Any:  # noqa: ANN401 - whatever it takes and returns
            return function(*args, **new_arguments(target.__name__, kwargs))

        if isinstance(target, type):
            target.__init__ = call  # pyright: ignore[reportAttributeAccessIssue]
            return target  # pyright: ignore[reportReturnType]
        return call  # pyright: ignore[reportReturnType]

    return decorate
