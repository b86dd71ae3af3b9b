"""`python -m benchmarks report`: writes a suite's leaderboard, as a page and as numbers."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

from benchmarks.files import csv_text, write_bytes, write_text
from benchmarks.report.leaderboard import Leaderboard, read_leaderboard
from benchmarks.report.page import drawn_plots, incomplete_counts, page_blocks
from benchmarks.report.standings import Pair
from benchmarks.report.statistics import Interval
from benchmarks.report.tables import ranks_table
from benchmarks.suites.suite import FrozenSuite
from pma_gym.cli.progress import StepProgress
from pma_gym.pages.document import TextTable, to_html, to_markdown
from pma_gym.pages.figures import picture_files, pngs

OnStep = Callable[[str, int, int], None]

PLOTS = "plots"
NUMBERS, PAIRS = "leaderboard.csv", "pairs.csv"
PAGE, TEXT = "report.html", "report.md"


def run_report(
    suite: FrozenSuite, results: Path, out: Path, vector: bool = False
) -> tuple[Path, TextTable, str]:
    """Read a run's results and write the page; says on stderr what it is at.

    Args:
        suite: the suite that was run.
        results: folder of the results.
        out: folder of the page; may be the same.
        vector: whether every picture is written as SVG and PDF too.
    Returns:
        The page, the ranks as a table for a terminal, and which controllers are left out of a
        measure because the run has not finished their cases (empty if none).
    Raises:
        SuiteError: there are no results of this suite and version.
    """
    with StepProgress() as progress:
        leaderboard = read_leaderboard(suite, results)
        page = write_leaderboard(leaderboard, out, progress, vector)
    ranks = ranks_table(leaderboard.shown, leaderboard.labels)
    return page, ranks, incomplete_counts(leaderboard)


def write_leaderboard(
    leaderboard: Leaderboard,
    out: Path,
    progress: OnStep = lambda *step: None,
    vector: bool = False,
) -> Path:
    """Write the page, as HTML, Markdown and pictures, and the numbers behind it.

    Args:
        leaderboard: what is to be shown.
        out: folder; made if need be.
        progress: called with a step's name, how much of it is done, and of how much.
        vector: whether every picture is written as SVG and PDF too.
    Returns:
        The page.
    """
    _compute(leaderboard, progress)
    progress("plots", 0, 1)
    files = picture_files(drawn_plots(leaderboard), vector)
    progress("plots", 1, 1)
    blocks, pictures = page_blocks(leaderboard), pngs(files)
    texts = {
        TEXT: to_markdown(blocks, pictures, PLOTS),
        PAGE: to_html(blocks, pictures),
        NUMBERS: numbers_csv(leaderboard),
        PAIRS: pairs_csv(leaderboard),
    }
    out.mkdir(parents=True, exist_ok=True)
    # All is computed before anything is replaced, so that no folder mixes two runs.
    shutil.rmtree(out / PLOTS, ignore_errors=True)
    for name, content in files.items():
        write_bytes(out / PLOTS / name, content)
    for name, text in texts.items():
        write_text(out / name, text)
    return out / PAGE


def _compute(leaderboard: Leaderboard, progress: OnStep) -> None:
    """Compute what takes its time, a step after the other; the leaderboard keeps it."""
    every = [*leaderboard.standings.values(), *leaderboard.by_task.values()]
    for done, each in enumerate(every):
        progress("standings and their intervals", done, len(every))
        _ = each.rows, each.pairs
    progress("standings and their intervals", len(every), len(every))
    progress("loops and margins", 0, 1)
    _ = leaderboard.loops
    progress("loops and margins", 1, 1)


def numbers_csv(leaderboard: Leaderboard) -> str:
    """A row a controller and measure or task, with all digits; errors in the row's unit."""
    intervals = ("mean", "median", "worst", "to_best", "to_bound")
    header = [
        "suite",
        "version",
        "measure",
        "unit",
        "controller",
        "cases",
        "failures",
        "best_rank",
        "worst_rank",
        "percent_of_range",
        *(f"{name}{end}" for name in intervals for end in ("", "_low", "_high")),
    ]
    suite, rows = leaderboard.suite, []
    every = leaderboard.by_task | leaderboard.standings
    for name, standings in every.items():
        measure, cases = standings.errors.measure, len(standings.errors.episodes)
        for row in standings.rows:
            ranks = [row.rank.best, row.rank.worst] if row.rank else ["", ""]
            values = [getattr(row, each) or (None, None, None) for each in intervals]
            rows.append(
                [suite.name, suite.version, name, measure.unit, row.name, cases, row.failures]
                + [*ranks, row.percent]
                + [value for interval in values for value in interval]
            )
    return _csv(header, rows)


def pairs_csv(leaderboard: Leaderboard) -> str:
    """A row a measure and pair of controllers: probability of improvement and ratio."""
    header = [
        "suite",
        "version",
        "measure",
        "first",
        "second",
        "first_is_better",
        *(f"{name}{end}" for name in ("improvement", "ratio") for end in ("", "_low", "_high")),
    ]
    suite = leaderboard.suite

    def cells(name: str, pair: Pair) -> list[object]:
        both: tuple[Interval, Interval] = (pair.improvement, pair.ratio)
        head = [suite.name, suite.version, name, pair.first, pair.second, pair.separated]
        return [*head, *(value for interval in both for value in interval)]

    return _csv(
        header,
        [
            cells(name, pair)
            for name, standings in leaderboard.standings.items()
            for pair in standings.pairs
        ],
    )


def _csv(header: list[str], rows: list[list[Any]]) -> str:
    """Rows as CSV; numbers with all digits, what is unknown empty."""
    return csv_text([header, *(map(_cell, row) for row in rows)])


def _cell(value: object) -> object:
    if isinstance(value, float):
        return "" if value != value else repr(float(value))
    return "" if value is None else value
