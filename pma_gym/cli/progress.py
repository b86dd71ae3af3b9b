"""Progress by step, beside the results: a bar where somebody watches, a line a step elsewhere."""

import sys
from types import TracebackType

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from pma_gym.terminal import SafeConsole


class StepProgress:
    """Shows which step a run is at; called with the step's name, how much is done, of how much."""

    def __init__(self) -> None:
        """Find out whether somebody watches."""
        console = SafeConsole(stderr=True)
        self._bars = (
            Progress(
                TextColumn("{task.description}", markup=False),
                BarColumn(),
                MofNCompleteColumn(),
                TimeElapsedColumn(),
                TextColumn("left in this step:"),
                TimeRemainingColumn(),
                console=console,
            )
            if console.is_terminal
            else None
        )
        self._tasks: dict[str, object] = {}

    def __enter__(self) -> "StepProgress":
        """Begin to show."""
        if self._bars:
            self._bars.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End; what was shown stays."""
        if self._bars:
            self._bars.stop()

    def __call__(self, step: str, done: int, total: int) -> None:
        """Show that a step has come so far."""
        if self._bars is None:
            if step not in self._tasks:
                self._tasks[step] = None
                print(f"{step} ...", file=sys.stderr, flush=True)
            return
        if step not in self._tasks:
            self._tasks[step] = self._bars.add_task(step, total=total)
        self._bars.update(self._tasks[step], completed=done, total=total)  # type: ignore[arg-type]
