"""A nominal model as a key of what is computed from it once a process."""

from pma_gym.plant.model import Model
from pma_gym.plant.program import structure


class ModelKey:
    """A nominal model that is equal to every other of the same laws and numbers: a key.

    Args:
        model: the model.
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        self._key = (*structure(model), model.vector().tobytes())
        self._hash = hash(self._key)

    def __hash__(self) -> int:
        """Of the laws and numbers."""
        return self._hash

    def __eq__(self, other: object) -> bool:
        """Whether laws and numbers are the same."""
        return isinstance(other, ModelKey) and self._key == other._key
