"""Files with the same content: a copy is no second measurement.

Copies make noise look repeatable and intervals too narrow. Contents are compared, not names: time
since the first row, commands and readings.
"""

import hashlib
from collections.abc import Sequence

import numpy as np

from pma_gym.data.trial import Trial

DIGITS = 9
"""Significant digits that are compared: a copy through a spreadsheet may lose the last ones."""


def copies(trials: Sequence[Trial]) -> dict[int, int]:
    """Find trials that repeat the content of an earlier one.

    Args:
        trials: the trials.
    Returns:
        Index of the earlier one by the index of the copy.
    """
    seen: dict[str, int] = {}
    originals = {}
    for number, trial in enumerate(trials):
        first = seen.setdefault(_content(trial), number)
        if first != number:
            originals[number] = first
    return originals


def _content(trial: Trial) -> str:
    """A digest of time, commands and readings."""
    digest = hashlib.sha256()
    columns = {"time": trial.time - trial.time[0], **trial.commands, **trial.measurements}
    for name in sorted(columns):
        values = columns[name]
        scale = float(np.nanmax(np.abs(values), initial=0.0)) or 1.0
        # Plus 0: a negative zero has other bytes.
        whole = np.rint(values / scale * 10.0**DIGITS) + 0.0
        digest.update(name.encode() + np.nan_to_num(whole, nan=-1e300).tobytes())
    return digest.hexdigest()
