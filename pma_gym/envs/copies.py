"""Copies and pickles of environments, which continue independently with the same bits."""

import copy
from collections.abc import Mapping
from typing import Any, ClassVar, Self

from pma_gym.engine.options import Options
from pma_gym.envs.setup import Setup
from pma_gym.pickling import Packed, packed


class Copies:
    """Support of `copy.copy`, `copy.deepcopy` and pickle for environments.

    A copy has a new engine, with code from the compile cache, and continues from the same state.
    All other attributes are copied.
    """

    _ATTACHED: ClassVar[frozenset[str]] = frozenset()
    """Attributes that point into the engine, set by `_attach`."""

    options: Options
    _setup_of: tuple[Options | None, Setup] = (None, ())

    def _made_as(self) -> Setup:
        """What decides how the environment goes on from a state."""
        raise NotImplementedError

    @property
    def _setup(self) -> Setup:
        """`_made_as` of the present options, made once: every state has it."""
        if self._setup_of[0] is not self.options:
            self._setup_of = self.options, self._made_as()
        return self._setup_of[1]

    def _attach(self) -> None:
        """Make what points into the engine."""
        raise NotImplementedError

    def _kept(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name not in self._ATTACHED}

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes for pickle.

        Raises:
            pickle.PicklingError: an option or the task's motion cannot be pickled; with the fix.
        """
        kept = self._kept()
        # These name what is wrong; the spec has it too, without a name.
        for part in (kept["options"], kept["task"].schedule):
            part.__getstate__()
        spec = kept.get("spec")
        return kept if spec is None else kept | {"spec": packed("spec", spec)}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        """Restore the attributes from `__getstate__`."""
        attributes = {n: v.value() if isinstance(v, Packed) else v for n, v in state.items()}
        self.__dict__.update(attributes)
        self._attach()

    def __copy__(self) -> Self:
        """Copy as `copy.deepcopy`, because environments cannot share an engine."""
        return copy.deepcopy(self)

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """Return an independent environment that continues with the same bits."""
        other = type(self).__new__(type(self))
        memo[id(self)] = other
        other.__dict__.update(copy.deepcopy(self._kept(), memo))
        other._attach()
        return other
