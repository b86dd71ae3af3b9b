"""An imposed motion's bandwidth after the rows of a long log were averaged."""

from collections.abc import Sequence

import numpy as np

from pma_gym.data.trial import Trial
from pma_gym.discovery.thresholds import RECORDED
from pma_gym.plant.model import Model

BANDWIDTH = "imposed_motion.bandwidth_hz"
"""Path of an imposed motion's bandwidth."""


def with_recorded_bandwidth(model: Model, trials: Sequence[Trial]) -> tuple[Model, tuple[str, ...]]:
    """A model whose motion is no faster than the rows of its trials, and words where that changes.

    Args:
        model: the model; one without an imposed motion stays as it is.
        trials: as they are fitted to.
    """
    if not model.rig.imposes_motion:
        return model, ()
    stated, recorded = model.parameters["imposed_motion"].bandwidth, recorded_bandwidth(trials)
    if stated <= recorded:
        return model, ()
    words = (
        f"imposed_motion.bandwidth_hz is taken as {recorded:.3g} Hz, not {stated:.4g} Hz: averaged "
        "rows record no faster motion"
    )
    return model.replace({BANDWIDTH: recorded}), (words,)


def recorded_bandwidth(trials: Sequence[Trial]) -> float:
    """Bandwidth (Hz) of the fastest motion that the rows of all trials record."""
    rates = [1.0 / float(np.median(np.diff(each.time))) for each in trials if len(each.time) > 1]
    return RECORDED * min(rates, default=np.inf)
