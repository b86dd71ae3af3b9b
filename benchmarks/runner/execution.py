"""Runs what is missing of a suite, and keeps every case as it is done."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, cast

from benchmarks.executors.executor import Executor, ProcessDied, run_all
from benchmarks.files import write_bytes
from benchmarks.runner.case import Case, Row, cases, failed_row, run_case
from benchmarks.runner.fingerprint import key
from benchmarks.runner.journal import JOURNAL, Journal, case_rows
from benchmarks.suites.suite import Entry, Episode, FrozenSuite
from pma_gym.envs import PMAEnv

TRACES = ("csv", "parquet")
"""Forms of time series."""

Identity = tuple[str, Episode]
"""What tells a case from a suite's others: the controller's name and the episode."""


@dataclass(frozen=True)
class PendingCases:
    """Cases to run, and rows that a journal already has.

    Attributes:
        suite: the suite.
        keys: fingerprint of each controller's rows, by its name.
        cases: every case of these controllers.
        known: rows of those that are done.
        outdated: rows of these controllers that were made with something else.
        traces: form of the time series that are written too; none if empty.
    """

    suite: FrozenSuite
    keys: Mapping[str, str]
    cases: tuple[Case, ...]
    known: Mapping[Identity, Row]
    outdated: int
    traces: str = ""

    @property
    def missing(self) -> list[Case]:
        """Cases that are not done."""
        return [case for case in self.cases if identity(case) not in self.known]


def identity(case: Case) -> Identity:
    """Return the identity of a case in its suite."""
    return case.spec.name, case.episode


def row_identity(row: Row) -> Identity:
    """Return the identity of a row in its suite and key."""
    return row["controller"], Episode(*(row[name] for name in Episode._fields))


def trace_file(case: Case, out: Path, form: str) -> Path:
    """Return the file of a case's time series in a folder of results."""
    return out / "traces" / f"{case.name.replace('/', '-')}.{form}"


def pending_cases(
    suite: FrozenSuite, entries: Iterable[Entry], out: Path, traces: str = ""
) -> PendingCases:
    """Return the cases of some controllers that a folder's journal lacks.

    A row counts only if its key is that of now. One whose process died counts as not run, and so
    does one whose time series are asked for and missing.
    """
    entries = tuple(entries)
    keys = {entry.spec.name: key(suite, entry.spec) for entry in entries}
    planned = tuple(cases(suite, entries))
    known, outdated = dict[Identity, Row](), 0
    for row in case_rows(out / JOURNAL):
        if row.get("controller") not in keys:
            continue
        if row.get("key") != keys[row["controller"]]:
            outdated += 1
        elif not row["failure"].startswith(ProcessDied.__name__):
            known[row_identity(row)] = row
    there = {
        identity(case) for case in planned if not traces or trace_file(case, out, traces).is_file()
    }
    known = {its: row for its, row in known.items() if its in there}
    return PendingCases(suite, keys, planned, known, outdated, traces)


def execute(
    todo: PendingCases,
    executor: Executor,
    out: Path,
    on_done: Callable[[Row], None],
    untrusted: bool = False,
) -> bool:
    """Run what is missing; each row is in the folder's journal before `on_done` is called.

    Args:
        todo: what is to be run.
        executor: where the cases run.
        out: folder of the journal.
        on_done: called with each row.
        untrusted: run no case twice, see `run_all`.
    Returns:
        Whether all of it was run; Ctrl-C ends the run at once, and what is done stays.
    """
    missing = todo.missing
    with Journal(out / JOURNAL) as journal:

        def keep(index: int, result: object) -> None:
            case = missing[index]
            made = failed_row(case, result) if isinstance(result, BaseException) else result
            row = {"key": todo.keys[case.spec.name]} | cast("dict[str, Any]", made)
            # What other code made goes with its row.
            for form in TRACES:
                trace_file(case, out, form).unlink(missing_ok=True)
            trace: bytes | None = row.pop("trace", None)  # type: ignore[assignment]
            if trace is not None:
                write_bytes(trace_file(case, out, todo.traces), trace)
            journal.append(row)
            on_done(row)

        return run_all([_work(case, todo) for case in missing], executor, keep, untrusted)


def _work(case: Case, todo: PendingCases) -> partial[Row]:
    """A case to be run in any process, which need not draw the station again."""
    return partial(run_case, case, todo.suite.station(case.episode.station).model, todo.traces)


def compile_kernels(suite: FrozenSuite) -> None:
    """Compile every kernel of a suite once, so that no process finds the cache empty."""
    structures = {
        tuple(suite.station(number).model.parameters): number for number in suite.stations
    }
    for number in structures.values():
        for task in suite.tasks:
            PMAEnv(task=task, model=suite.station(number).model, **suite.environment)
