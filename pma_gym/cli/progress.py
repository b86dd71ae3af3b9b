"""Progress by step on stderr: a bar on a terminal, a line per step elsewhere."""

import sys
import time

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from pma_gym.terminal import SafeConsole

PAUSE_S = 60.0
"""Time (s) between two progress lines of the same step without a terminal."""


class StepProgress:
    """Show the progress of a run; call it with the step's name, the amount done and the total."""

    def __init__(self) -> None:
        """Find out whether the output is a terminal."""
        console = SafeConsole(stderr=True)
        columns = (
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("left in this step:"),
            TimeRemainingColumn(),
        )
        self._bars = Progress(*columns, console=console) if console.is_terminal else None
        self._tasks: dict[str, TaskID] = {}
        self._step = ""
        self._said = 0.0

    def __enter__(self) -> "StepProgress":
        """Start the display."""
        if self._bars:
            self._bars.start()
        return self

    def __exit__(self, *error: object) -> None:
        """Stop the display; its last state stays visible."""
        if self._bars:
            self._bars.stop()

    def __call__(self, step: str, done: int, total: int) -> None:
        """Show the progress of a step."""
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
        so_far = "" if begins else f" {done} of {total}"
        print(f"{step}{so_far} ...", file=sys.stderr, flush=True)
        self._said = now
