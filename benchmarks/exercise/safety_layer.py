"""The command `safety`: runs the episodes, prints the counts, keeps the figures."""

import json
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from benchmarks.executors.executor import Executor
from benchmarks.exercise.safety_episodes import Safety, Tally, measure
from benchmarks.exercise.tables import NONE
from benchmarks.files import write_text
from pma_gym.cli.terminal import terminal_table
from pma_gym.document_shape import ListOf, Whole, check_shape, shape_of
from pma_gym.documents import read_json
from pma_gym.pages.document import TextTable, to_markdown
from pma_gym.tasks.exercise import SAFE_MOMENT, SAFE_SPEED
from pma_gym.units import SI_FACTORS

FIGURES = "safety.json"


class SafetyError(ValueError):
    """Episodes that cannot be run; the message says why."""


def run_safety(
    episodes: int, bare: int, seed: int, out: Path, console: Console, executor: Executor
) -> Safety:
    """Measure, print and write.

    Args:
        episodes: with the safety layer.
        bare: without it, to be compared with.
        seed: of the benchmark.
        out: folder for `safety.json` and `safety.md`.
        console: where to print.
        executor: where blocks of episodes run.
    Raises:
        SafetyError: a number of episodes or a seed that is none.
    """
    for name, value, least in (("episodes", episodes, 1), ("bare", bare, 0), ("seed", seed, 0)):
        if value < least:
            raise SafetyError(f"--{name} must be a whole number from {least} on, got {value}")
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task("Episodes", total=episodes + bare)

        def advance(done: int) -> None:
            progress.advance(task, done)

        tallies = (
            *measure(episodes, seed, True, executor, advance),
            *measure(bare, seed, False, executor, advance),
        )
    safety = Safety(seed, tallies)
    shown = safety_table(safety)
    console.print(terminal_table(shown), "")
    console.print(safety_text(safety), highlight=False)
    write_text(out / FIGURES, json.dumps(safety.to_json(), indent=1) + "\n")
    write_text(out / "safety.md", f"{to_markdown([shown], {}, '')}\n{safety_text(safety)}\n")
    console.print(f"Figures: {out / FIGURES}", highlight=False)
    return safety


def safety_table(safety: Safety) -> TextTable:
    """A row for every task, kind of stations and agent."""
    header = [
        "Task",
        "Stations",
        "Agent",
        "Layer | episodes",
        "Layer | unsafe",
        "Layer | N m",
        "Layer | deg/s",
        "None | episodes",
        "None | unsafe",
    ]
    bare = {(t.task, t.stations, t.agent): t for t in safety.tallies if not t.safety}
    rows = []
    for tally in (t for t in safety.tallies if t.safety):
        without = bare.get((tally.task, tally.stations, tally.agent))
        compared = [f"{without.episodes}", f"{without.violations}"] if without else [NONE, NONE]
        rows.append([*_cells(tally), *compared])
    limits = f"{SAFE_MOMENT:g} N m, {SAFE_SPEED / SI_FACTORS['deg']:g} deg/s"
    return TextTable(
        f"Episodes with and without the safety layer; safe: up to {limits}", header, rows, words=3
    )


def _cells(tally: Tally) -> list[str]:
    peaks = f"{tally.peak_moment_nm:.1f}", f"{tally.peak_speed_deg_s:.1f}"
    name = tally.task.removesuffix("_exercise")
    return [name, tally.stations, tally.agent, f"{tally.episodes}", f"{tally.violations}", *peaks]


def safety_text(safety: Safety) -> str:
    """The whole in a sentence or two."""
    episodes, violations, most = safety.total(True)
    bare, broken, _ = safety.total(False)
    said = (
        f"With the safety layer {violations} of {episodes} episodes were unsafe "
        f"(seed {safety.seed}; at most {100.0 * most:.2g} % with 95 % confidence)"
    )
    return f"{said}; without it {broken} of {bare}." if bare else f"{said}."


def read_safety(path: Path) -> Safety:
    """Figures that `run_safety` kept.

    Raises:
        SafetyError: a damaged file; says how it is written anew.
    """
    try:
        kept = read_json(path, "journal_mib", own=True)
        check_shape(kept, {"seed": Whole(), "tallies": ListOf(shape_of(Tally))})
    except ValueError as error:
        raise SafetyError(f"{error}; run `python -m benchmarks safety` again") from None
    return Safety(kept["seed"], tuple(Tally(**tally) for tally in kept["tallies"]))
