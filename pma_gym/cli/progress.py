"""Progress by step on stderr: a bar on a terminal, a line per step elsewhere.

Estimate of the remaining time of a diagnosis or a fit, from its steps so far.
"""

import re
import sys
import time
from collections.abc import Callable, Mapping
from statistics import median

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text

from pma_gym.terminal import SafeConsole

REFIT = "refitting parameters"
LOOK = "looking for effect"
FITS = "fitting effect"
RESTARTS = "fitting effect from more beginnings"
LEFT_OUT = "trials left out"
ANSWER = "putting the answer together"

_END = (LEFT_OUT, ANSWER)
FIT: Mapping[str, tuple[str, ...]] = {REFIT: _END, LEFT_OUT: (ANSWER,), ANSWER: ()}
"""Steps that follow each step of a fit."""

_SEARCH_ON = (LOOK, *_END)
DIAGNOSIS: Mapping[str, tuple[str, ...]] = {
    **FIT,
    REFIT: _SEARCH_ON,
    LOOK: _END,
    FITS: _SEARCH_ON,
    RESTARTS: _SEARCH_ON,
}
"""Steps that follow each step of a diagnosis, unless a further effect is added: then `FITS` and
another `LOOK` come between."""

SHARES = {REFIT: 10.0, LOOK: 3.0, FITS: 20.0, RESTARTS: 20.0, LEFT_OUT: 7.0, ANSWER: 1.0}
"""Processor time of the steps relative to each other, measured on one trial of 20 000 rows and on
five of 3000 rows, with hysteresis hidden in them."""


class TimeLeft:
    """Estimate the remaining time; call it as a diagnosis calls its `progress`.

    A step that ran before in this run is expected to take the same time again. Another step is
    expected to take its usual share of the time relative to those.

    Args:
        following: for each step, without its number, the steps that follow.
        clock: function that returns the time in s.
    """

    def __init__(
        self,
        following: Mapping[str, tuple[str, ...]],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Start without an estimate."""
        self._following = following
        self._clock = clock
        self._took: dict[str, float] = {}
        self._step = ""
        self._step_start = 0.0
        self._done, self._total = 0, 0

    def __call__(self, step: str, done: int, total: int) -> None:
        """Record the progress of a step."""
        now = self._clock()
        if step != self._step:
            if self._step:
                self._took[_kind(self._step)] = now - self._step_start
            self._step, self._step_start = step, now
        self._done, self._total = done, total

    def seconds(self) -> tuple[float, float] | None:
        """Remaining time (s) without a further effect, and with one more.

        It is None before the first step has ended, and in unknown steps.
        """
        kind = _kind(self._step)
        if not self._took or kind not in self._following:
            return None
        least = self._rest(kind) + sum(map(self._expected, self._following[kind]))
        if LOOK not in self._following[kind] and kind != LOOK:
            return least, least
        return least, least + self._expected(FITS) + self._expected(LOOK)

    def text(self) -> str:
        """The remaining time as text; "" if it is unknown."""
        left = self.seconds()
        if left is None:
            return ""
        least, most = map(_duration, left)
        also = f" ({most} if it adds an effect)" if most != least else ""
        return f"{least} left{also}"

    def _rest(self, kind: str) -> float:
        """Seconds that are left of the step that runs: by its pace, once it has one."""
        so_far = self._clock() - self._step_start
        if 0 < self._done < self._total:
            return so_far / self._done * (self._total - self._done)
        return max(self._expected(kind) - so_far, 0.0)

    def _expected(self, kind: str) -> float:
        """Seconds that a whole step takes."""
        if kind in self._took:
            return self._took[kind]
        # The median: fits that --resume read from the journal took no time.
        paces = [took / SHARES[each] for each, took in self._took.items() if each in SHARES]
        return SHARES[kind] * median(paces)


def _kind(step: str) -> str:
    """A step's name without its number: `looking for effect 2` is one of `looking for effect`."""
    return re.sub(r" \d+", "", step)


def _duration(seconds: float) -> str:
    if seconds < 45.0:
        return "less than a minute"
    if seconds < 90.0 * 60.0:
        return f"about {round(seconds / 60.0) or 1} min"
    return f"about {seconds / 3600.0:.1f} h"


PAUSE_S = 60.0
"""Time (s) between two progress lines of the same step without a terminal."""


class StepProgress:
    """Show the progress of a run; call it with the step's name, the amount done and the total.

    Args:
        time_left: estimate of the remaining time of all steps; None shows none.
    """

    def __init__(self, time_left: TimeLeft | None = None) -> None:
        """Find out whether the output is a terminal."""
        self._left = time_left
        console = SafeConsole(stderr=True)
        self._bars = Progress(*self._columns(), console=console) if console.is_terminal else None
        self._tasks: dict[str, TaskID] = {}
        self._step = ""
        self._said = 0.0

    def _columns(self) -> list[ProgressColumn]:
        columns = [
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("left in this step:"),
            TimeRemainingColumn(),
        ]
        return [*columns, _OverallColumn(self)] if self._left else columns

    def __enter__(self) -> "StepProgress":
        """Start the display."""
        if self._bars:
            self._bars.start()
        return self

    def __exit__(self, *error: object) -> None:
        """Stop the display; its last state stays visible."""
        self._step = ""
        if self._bars:
            self._bars.stop()

    def __call__(self, step: str, done: int, total: int) -> None:
        """Show the progress of a step."""
        if self._left:
            self._left(step, done, total)
        begins, self._step = step != self._step, step
        if self._bars is None:
            self._say(step, done, total, begins)
            return
        if step not in self._tasks:
            self._tasks[step] = self._bars.add_task(step, total=total)
        self._bars.update(self._tasks[step], completed=done, total=total)

    def _say(self, step: str, done: int, total: int, begins: bool) -> None:
        """Print a line where a step begins, and where one lasts."""
        now = time.monotonic()
        if not begins and now - self._said < PAUSE_S:
            return
        left = self._left.text() if self._left else ""
        so_far = "" if begins else f" {done} of {total}"
        print(f"{step}{so_far} ...{left and f' {left}'}", file=sys.stderr, flush=True)
        self._said = now

    def overall(self, step: str) -> str:
        """Text with the remaining time of all steps, for the running step; "" for the others."""
        return self._left.text() if self._left and step == self._step else ""


class _OverallColumn(ProgressColumn):
    """The time that is left of all steps, beside the bar of the step that runs."""

    max_refresh = 1.0

    def __init__(self, progress: StepProgress) -> None:
        super().__init__()
        self._progress = progress

    def render(self, task: Task) -> Text:
        rest = self._progress.overall(task.description)
        return Text(f"in all: {rest}" if rest else "")
