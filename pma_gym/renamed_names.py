"""Old names of classes, functions and attributes: they work, with a deprecation warning."""

import sys
import warnings
from collections.abc import Callable, Mapping
from typing import Any


def warn_renamed(what: str, new: str, stacklevel: int = 3) -> None:
    """Warn the caller that a name is deprecated.

    Args:
        what: the old name, with what it is of.
        new: the new name.
        stacklevel: as `warnings.warn` counts it from here.
    """
    warnings.warn(f"{what} is now {new}; use that name", DeprecationWarning, stacklevel)


def renamed_names(module: str, names: Mapping[str, Any]) -> Callable[[str], Any]:
    """Make the `__getattr__` of a module with renamed names.

    Args:
        module: the module's name.
        names: what each old name stands for: a class or function, or the new name of a constant.
    """

    def lookup(name: str) -> Any:  # noqa: ANN401 - whatever the name stands for
        if name not in names:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        new = names[name]
        warn_renamed(f"{module}.{name}", new if isinstance(new, str) else new.__name__)
        return getattr(sys.modules[module], new) if isinstance(new, str) else new

    return lookup


def renamed_attribute(old: str, new: str) -> property:
    """Make a property for an attribute's old name.

    Args:
        old: the old name.
        new: the attribute that it stands for.
    """

    def read(self: object) -> Any:  # noqa: ANN401 - whatever the attribute holds
        warn_renamed(f"{type(self).__name__}.{old}", new)
        return getattr(self, new)

    read.__doc__ = f"Old name of `{new}`."
    return property(read)
