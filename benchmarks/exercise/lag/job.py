"""The command `lag`: the bounds of an exercise, printed and kept."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from benchmarks.exercise.lag.bounds import FIRST_SEED, LAG_FACTORS, LagBounds, lag_bounds
from benchmarks.exercise.lag.plots import bound_plot
from benchmarks.exercise.lag.tables import bound_tables
from benchmarks.files import write_bytes, write_text
from pma_gym.tasks import EXERCISES


class LagError(ValueError):
    """Bounds that cannot be computed; the message says why."""


def run_lag(
    task: str,
    operators: int,
    pressures_kpa: Sequence[float],
    safety: bool,
    out: Path,
    console: Console,
) -> LagBounds:
    """Compute, print and write the bounds.

    Args:
        task: name of the exercise.
        operators: how many are searched for; 0 leaves the linear bounds alone.
        pressures_kpa: pressures that their episodes begin at (kPa); none for one by the seed.
        safety: also with the safety layer.
        out: folder for `bounds.md` and `bounds.png`.
        console: where to print.
    Raises:
        LagError: no such exercise, or fewer than no operators.
    """
    if task not in EXERCISES:
        raise LagError(f"task must be one of {', '.join(EXERCISES)}, got {task!r}")
    if operators < 0:
        raise LagError(f"--operators must be a whole number from 0 on, got {operators}")
    safeties = (False, True) if safety else (False,)
    rows = operators * max(1, len(pressures_kpa)) * len(LAG_FACTORS) * len(safeties)
    with Progress(console=console, transient=True) as progress:
        shown = progress.add_task("Searches", total=rows)
        bounds = lag_bounds(
            task,
            range(FIRST_SEED, FIRST_SEED + operators),
            list(pressures_kpa) or ("random",),
            safeties=safeties,
            on_row=lambda: progress.advance(shown),
        )
    text = "\n\n".join(bound_tables(bounds))
    console.print(text, highlight=False, markup=False, soft_wrap=True)
    write_text(out / "bounds.md", text + "\n")
    write_bytes(out / "bounds.png", bound_plot(bounds.causal, bounds.swings))
    console.print(f"Picture: {out / 'bounds.png'}", highlight=False)
    return bounds
