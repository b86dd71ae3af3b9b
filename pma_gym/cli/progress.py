"""Progress by step on stderr: a bar on a terminal, a line per step elsewhere."""

import sys
import time

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

from pma_gym.cli.time_left import TimeLeft
from pma_gym.terminal import SafeConsole

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
        left = self._left.words() if self._left else ""
        so_far = "" if begins else f" {done} of {total}"
        print(f"{step}{so_far} ...{left and f' {left}'}", file=sys.stderr, flush=True)
        self._said = now

    def overall(self, step: str) -> str:
        """Text with the remaining time of all steps, for the running step; "" for the others."""
        return self._left.words() if self._left and step == self._step else ""


class _OverallColumn(ProgressColumn):
    """The time that is left of all steps, beside the bar of the step that runs."""

    max_refresh = 1.0

    def __init__(self, progress: StepProgress) -> None:
        super().__init__()
        self._progress = progress

    def render(self, task: Task) -> Text:
        words = self._progress.overall(task.description)
        return Text(f"in all: {words}" if words else "")
