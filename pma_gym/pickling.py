"""Pickling of users' objects: functions by value where other processes cannot import them.

Pickle sends a function by the name of its module, which fails for a lambda, for a function inside
another one and, in another process, for one of a notebook. Gymnasium sends environments to its
workers by cloudpickle for the same reason, and brings it along.
"""

import pickle
from typing import NamedTuple


class Packed(NamedTuple):
    """A value stored as a pickle.

    Attributes:
        data: what `pickle.loads` makes the value of.
    """

    data: bytes

    def value(self) -> object:
        """Unpickle the value; it is as trustworthy as the pickle around it."""
        return pickle.loads(self.data)


def packed(name: str, value: object) -> Packed:
    """Prepare a value for pickle.

    Args:
        name: what users call it, such as an option's name.
        value: the value.
    Raises:
        pickle.PicklingError: the value cannot be pickled; names it, the reason and the fix.
    """
    # Imported here: who pickles nothing waits for no import of Gymnasium.
    from gymnasium.vector.utils import CloudpickleWrapper

    try:
        # Made for functions that make environments; it takes any value.
        return Packed(CloudpickleWrapper(value).__getstate__())  # type: ignore[arg-type]
    except Exception as error:
        raise pickle.PicklingError(
            f"{name} cannot be pickled, got {value!r} ({error}); give a function or an object that "
            "holds plain data: no open file, lock, thread or generator"
        ) from error
