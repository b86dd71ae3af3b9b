"""Commands of a slower writer: in every second or twelfth row only, the cells between them empty.

Whether such a command stands still until its next value or moves there in a line, the log does not
say: `interpolation` under `[format]` of a `dataset.toml` does, "zoh" (held, the default) or "foh".
A hole so long that it is a gap is never joined.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.quality.gaps import LONGEST_S, TIMES
from pma_gym.data.trial import Trial
from pma_gym.data.trial_columns import BY_QUANTITY

Array = NDArray[np.float64]

_ROUNDING = 1e-9
"""Share of a command's range in which two values are one."""


def joined(values: Array, time: Array) -> Array:
    """A command with its empty cells (NaN) filled by lines between its values, but for gaps.

    Args:
        values: of the command, shape (n,).
        time: increasing times (s), shape (n,).
    """
    known = np.flatnonzero(np.isfinite(values))
    if known.size < 2:
        return values
    apart = np.diff(time[known])
    limit = max(LONGEST_S, TIMES * float(np.median(apart)))
    before = np.searchsorted(known, np.arange(values.size), side="right") - 1
    bridged = apart[np.clip(before, 0, apart.size - 1)] <= limit
    lines = np.interp(time, time[known], values[known], left=np.nan, right=np.nan)
    return np.where(np.isnan(values) & bridged, lines, values)


def held_commands(trial: Trial, stated: bool) -> Iterator[str]:
    """Messages on commands that are held over empty cells, where a line would be another command.

    Args:
        trial: what was read.
        stated: whether `[format]` says so.
    """
    for name, values in trial.commands.items():
        known = np.isfinite(values)
        if known.all() or not known.any():
            continue
        last = np.maximum.accumulate(np.where(known, np.arange(values.size), 0))
        lines = joined(values, trial.time)
        with np.errstate(invalid="ignore"):
            other = np.abs(lines - values[last]) > _ROUNDING * np.ptp(values[known])
        if other.any():
            column = BY_QUANTITY[name].name
            why = (
                ', as interpolation = "zoh" under [format] says'
                if stated
                else '; if it goes to its next value in a line, write interpolation = "foh" under '
                '[format] of dataset.toml, else interpolation = "zoh"'
            )
            yield (
                f"{column} is empty in {np.sum(~known)} of {known.size} rows, there it is held at "
                f"the value before{why}"
            )
