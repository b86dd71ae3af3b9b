"""The command `speed`: rounds over all rows, their medians, and the ratios with targets.

Every round measures every row once, in a new process and another order, so a slow minute of the
machine falls on all rows alike; a ratio is taken within each round, then its median.
"""

import json
import os
import random
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from statistics import median, quantiles

from rich.console import Console

from benchmarks.files import write_text
from benchmarks.runner.provenance import environment_info
from benchmarks.speed.peers import ROOT, Row, all_rows
from pma_gym.cli.terminal import terminal_table
from pma_gym.files import OutputError, check_output
from pma_gym.pages.document import TextTable
from pma_gym.terminal import SafeConsole

DONE, FAILED, INTERRUPTED = 0, 1, 130
"""Exit codes."""

SEED, LONGEST_S, PAUSE_S = 2008, 600.0, 0.02
"""Of the order; longest time of a measurement with all that it compiles (s); time before one (s),
in which threads of the last that still spin go to sleep."""

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""What holds libraries to one thread, unless a row asks them for more."""

SINGLE, BATCH = "single/own", "batch/own/1024"

TOY, TOYS = "single/CartPole", "batch/sync_Pendulum/1024"

CHECKS = (
    (SINGLE, TOY, 1.7),
    (BATCH, TOYS, 18.0),
    (BATCH, SINGLE, 3.0),
    ("batch/own_two/1024", BATCH, 1.5),
    ("single/joint", TOY, 1.5),
    ("single/slide", TOY, 1.5),
    ("single/valve_pair", TOY, 0.5),
    ("batch/joint/1024", TOYS, 15.0),
    ("batch/slide/1024", TOYS, 15.0),
    ("batch/valve_pair/1024", TOYS, 8.0),
)
"""This package's row, a pattern of rows the fastest of which divides it, and the least ratio: what
falls short when a step has more overhead, or a batch is no longer computed in lanes or by threads.
"""

TARGETS = (
    *CHECKS,
    (SINGLE, "single/Pendulum", 2.9),
    (SINGLE, "single/InvertedPendulum", 6.0),
    (SINGLE, "single/gem_*", 30.0),
    (SINGLE, "single/pcgym", 100.0),
    (BATCH, "batch/envpool_CartPole/1024", 1.8),
    ("rollouts/own/64", "rollouts/Pendulum/8", 9.0),
    ("rollouts/own/256", "rollouts/Pendulum/8", 18.0),
)

Rates = Mapping[str, Mapping[int, float]]
"""Steps per second by the row's key and the number of the round."""


class RequestError(ValueError):
    """A request that cannot be met; the message names reason and alternatives."""


class Absent(Exception):
    """A row that cannot be measured; the message says why."""


def run_speed(
    json_file: Path | None = None,
    check: bool = False,
    only: str = "",
    quick: bool = False,
    console: Console | None = None,
) -> int:
    """Measure this package beside what is installed of others.

    Args:
        json_file: file for all figures of a run that ends, if any.
        check: measure only the rows of `CHECKS`, and judge them.
        only: patterns of rows by commas; all if empty.
        quick: a smoke run, whose figures say little.
        console: where to print; the terminal if not given.
    Returns:
        Exit code: 0, 1 if a check failed, 130 if the run was interrupted.
    Raises:
        RequestError: the file cannot be written, or a pattern matches no row.
    """
    if json_file is not None:
        try:
            check_output(json_file)
        except OutputError as error:
            raise RequestError(f"--json: {error}") from None
    console = console or (SafeConsole() if sys.stdout.isatty() else SafeConsole(width=120))
    targets = CHECKS if check else TARGETS
    rows = select(only, all_rows())
    if check:
        rows = [row for row in rows if any(matches(row.key, p) for one in CHECKS for p in one[:2])]
    rounds, seconds = (2, 0.05) if quick else (7, 0.5)
    rates: dict[str, dict[int, float]] = {row.key: {} for row in rows}
    absences: dict[str, str] = {}
    code = DONE
    try:
        _measure(rows, rounds, seconds, rates, absences, console)
    except KeyboardInterrupt:
        code = INTERRUPTED
        console.print("Interrupted: what follows is what was measured so far.")
    _print(rows, rates, absences, console)
    missed = _judge([(target, ratio(target, rates)) for target in targets], console)
    if json_file is not None and code == DONE:
        content = environment_info() | {"rounds": rounds, "seconds": seconds}
        write_text(json_file, json.dumps(content | {"per_second": rates, "absent": absences}))
        console.print(f"Written to {json_file}", highlight=False)
    return code or (FAILED if check and _fails(missed, rows) else DONE)


def select(patterns: str, rows: list[Row]) -> list[Row]:
    """Rows whose key matches one of some patterns, by commas; all if empty.

    A pattern is a key with * for any text, or what keys begin with: `single`, `batch/own`.

    Raises:
        RequestError: a pattern that matches nothing; names the groups and contenders.
    """
    chosen = [part.strip().rstrip("/") for part in patterns.split(",") if part.strip()]
    for pattern in chosen:
        if not any(matches(row.key, pattern) for row in rows):
            stems = dict.fromkeys("/".join(row.key.split("/")[:2]) for row in rows)
            raise RequestError(f"--only: no row {pattern!r}; there are {', '.join(stems)}")
    return [row for row in rows if not chosen or any(matches(row.key, p) for p in chosen)]


def matches(key: str, pattern: str) -> bool:
    """Whether a key is meant by a pattern: the same with * for any text, or what it begins with."""
    return fnmatchcase(key, pattern) or fnmatchcase(key, f"{pattern}/*")


def _measure(
    rows: Sequence[Row],
    rounds: int,
    seconds: float,
    rates: dict[str, dict[int, float]],
    absences: dict[str, str],
    console: Console,
) -> None:
    order = random.Random(SEED)
    for number in range(rounds):
        with console.status(f"Round {number + 1} of {rounds}"):
            for row in order.sample(rows, len(rows)):
                if row.key in absences:
                    continue
                try:
                    rates[row.key][number] = measure(row, seconds)
                except Absent as reason:
                    absences[row.key] = str(reason)


def measure(row: Row, seconds: float) -> float:
    """Steps per second of a row, measured for a while (s) in a process of its own.

    Raises:
        Absent: it cannot be measured here, or its process failed.
    """
    if (os.cpu_count() or 1) < row.cores:
        raise Absent(f"needs {row.cores} cores")
    if row.peer.python is None:
        raise Absent(f"{row.peer.title} is not installed with these pins; `make peers` does it")
    worker = str(Path(__file__).with_name("worker.py"))
    command = [str(row.peer.python), "-P", worker, row.make, json.dumps(row.settings), str(seconds)]
    time.sleep(PAUSE_S)
    try:
        done = subprocess.run(
            command,
            cwd=ROOT,
            env=os.environ | ONE_THREAD,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=LONGEST_S,
        )
    except subprocess.TimeoutExpired:
        raise Absent(f"took longer than {LONGEST_S:g} s") from None
    if done.returncode:
        last_line = done.stderr.strip().splitlines()[-1:]
        raise Absent(": ".join([f"its process ended with exit code {done.returncode}", *last_line]))
    answer = json.loads(done.stdout.splitlines()[-1])
    return answer["steps"] / answer["seconds"]


def ratio(target: tuple[str, str, float], rates: Rates) -> list[float]:
    """A target's ratio in every round that has both rows; the fastest of the others counts."""
    own, pattern, _ = target
    others = [one for key, one in rates.items() if one and matches(key, pattern)]
    if not others:
        return []
    other, mine = max(others, key=lambda one: median(one.values())), rates.get(own, {})
    return [mine[number] / other[number] for number in sorted(mine.keys() & other.keys())]


def _print(
    rows: Sequence[Row], rates: Rates, absences: Mapping[str, str], console: Console
) -> None:
    measured = [(row, list(rates[row.key].values())) for row in rows if rates[row.key]]
    cells = [[row.key, row.title, rate(median(each)), spread(each)] for row, each in measured]
    console.print(terminal_table(TextTable("", ("Row", "What", "Steps/s", "±"), cells, 2)))
    for key, why in absences.items():
        console.print(f"Left out: {key}: {why}", highlight=False, markup=False)


def _judge(
    verdicts: Sequence[tuple[tuple[str, str, float], list[float]]], console: Console
) -> list[tuple[str, str]]:
    """Print the ratios; returns the rows of those that are missed or not measured."""
    rows, missed = [], []
    for (own, other, least), ratios in verdicts:
        middle = median(ratios) if ratios else None
        if middle is None or middle < least:
            missed.append((own, other))
        cells = ("not measured", "") if middle is None else (f"{middle:.3g}", spread(ratios))
        rows.append([own, other, f"{least:g}", *cells])
    header = ("Row", "Over", "At least", "Median", "±")
    console.print(terminal_table(TextTable("", header, rows, 2)))
    return missed


def _fails(missed: Sequence[tuple[str, str]], rows: Sequence[Row]) -> bool:
    """Whether a check fails: what this machine has too few cores for is excused."""
    cores = {row.key: row.cores for row in rows}
    failed = [pair for pair in missed if cores.get(pair[0], 1) <= (os.cpu_count() or 1)]
    for own, other in failed:
        print(f"failed: {own} over {other}: too slow, or not measured", file=sys.stderr)
    return bool(failed)


def spread(values: Sequence[float]) -> str:
    """Half of what lies between the quartiles, in percent of the median."""
    if len(values) < 2:
        return ""
    low, middle, high = quantiles(values, n=4, method="inclusive")
    return f"{50.0 * (high - low) / middle:.0f} %"


def rate(value: float) -> str:
    """A rate in three digits.

    >>> rate(1234567.0), rate(20000.0), rate(950.0)
    ('1.23 M', '20.0 k', '950')
    """
    for factor, letter in ((1e6, " M"), (1e3, " k")):
        if value >= 0.9995 * factor:
            return f"{value / factor:#.3g}".rstrip(".") + letter
    return f"{value:.3g}"
