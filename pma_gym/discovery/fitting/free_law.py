"""A law of free shape as a candidate."""

import numpy as np

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.effects import CATALOGUE
from pma_gym.plant.model import Model


def free_law(model: Model, name: str, ends: tuple[float, float]) -> CandidateEffect:
    """A law that does nothing, straight between heights at even distances.

    Args:
        model: that it is to be beside.
        name: in the catalogue.
        ends: least and greatest value of what it goes with (file unit).
    """
    file_keys = list(CATALOGUE[name].names_in_files())
    heights = file_keys[2:]
    table = dict(zip(file_keys, (ends[0], ends[1] - ends[0], *([0.0] * len(heights))), strict=True))
    every = np.ones(len(heights), bool)
    return CandidateEffect(
        name,
        name,
        model.with_effects({name: table}),
        tuple(f"{name}.{file_key}" for file_key in heights),
        every,
        np.zeros(len(heights)),
        np.eye(len(heights)),
        every,
        every,
    )
