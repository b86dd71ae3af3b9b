"""The main job: run the reproduction, write its results, say how it went."""

import shutil
from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console

from benchmarks.bounds import Bounds
from benchmarks.executors.executor import Executor, run_all
from benchmarks.files import write_bytes, write_text
from benchmarks.reproduction.page import report_blocks, report_pictures
from benchmarks.reproduction.replay import all_replay_errors
from benchmarks.reproduction.results import Results, Score, json_text, scores_csv, scores_of
from benchmarks.reproduction.tables import summary_table
from benchmarks.reproduction.targets import Check, check_targets
from benchmarks.runner.case import Case, drive
from benchmarks.runner.execution import PendingCases, identity, pending_cases
from benchmarks.runner.provenance import check_run, read_run
from benchmarks.runner.run import FAILED, INTERRUPTED, SuiteRun, run_missing, say_interrupted
from benchmarks.suites.reproduction import ReproductionSuite
from benchmarks.suites.suite import SuiteError
from pma_gym.cli.terminal import terminal_table
from pma_gym.data.trial import Trial
from pma_gym.pages.document import to_html, to_markdown
from pma_gym.pages.figures import picture_files, pngs


def print_summary(results: Results, report: Path, console: Console) -> None:
    """Tables 22 and 30 condensed, the speed, and where the report is."""
    console.print(terminal_table(summary_table(results)))
    print_failures(results, console)
    info = results.info
    console.print(
        f"{info['environment_steps']} environment steps in {info['wall_time_s']:.0f} s with "
        f"{info['jobs']} processes; in one: {info['environment_steps_per_second']:.0f} a second, "
        f"{info['case_steps_per_second']:.0f} with controllers and scoring",
        highlight=False,
    )
    console.print(f"Report: {report}", highlight=False, soft_wrap=True)


def print_failures(results: Results, console: Console) -> None:
    """Print why cases failed: each reason once, with the count and the first cases."""
    if not results.failures:
        return
    console.print(
        f"{len(results.failures)} cases failed, all others are scored:",
        highlight=False,
    )
    for names, reason in results.failure_reasons():
        console.print(f"  {names}: {reason}", markup=False, highlight=False)


PLOTS = "plots"


def write_report(results: Results, out: Path, vector: bool = False) -> None:
    """Write everything; all is computed before anything is replaced, so no folder mixes two runs.

    Args:
        results: the run.
        out: folder; made if need be.
        vector: whether every picture is written as SVG and PDF too.
    """
    files = picture_files(report_pictures(results), vector)
    pictures = pngs(files)
    checks = check_targets(results)
    blocks = report_blocks(results)
    errors = all_replay_errors(results, results.suite.models[0])
    texts = {
        "report.md": to_markdown(blocks, pictures, PLOTS),
        "report.html": to_html(blocks, pictures),
        "scores.csv": scores_csv(results.scores),
        "scores.json": json_text(
            results,
            targets=[asdict(check) | {"verdict": check.verdict} for check in checks],
            replay_errors=[asdict(error) for trials in errors.values() for error in trials],
        ),
    }
    shutil.rmtree(out / PLOTS, ignore_errors=True)
    for name, content in files.items():
        write_bytes(out / PLOTS / name, content)
    for name, text in texts.items():
        write_text(out / name, text)


Pictured = dict[tuple[str, str, float], Trial]
"""Trials by controller, task and pressure (kPa)."""


def pictured_trials(
    suite: ReproductionSuite, todo: PendingCases, failed: set[str], executor: Executor
) -> Pictured:
    """The trials of a run that its report draws: the same bits as those that were scored.

    Args:
        suite: what was run.
        todo: its cases.
        failed: names of cases that have no trial.
        executor: where they are driven.
    Returns:
        The trials; one that cannot be driven again is left out.
    Raises:
        KeyboardInterrupt: Ctrl-C.
    """
    drawn = [c for c in todo.cases if suite.is_pictured(c.episode) and c.name not in failed]
    trials: dict[int, Trial] = {}

    def keep(index: int, result: object) -> None:
        if isinstance(result, Trial):
            trials[index] = result

    if not run_all([partial(_driven, case) for case in drawn], executor, keep):
        raise KeyboardInterrupt
    return {
        (name, episode.task, episode.pressure_kpa): trials[index]
        for index, case in enumerate(drawn)
        for name, episode in [identity(case)]
        if index in trials
    }


def _driven(case: Case) -> Trial:
    return drive(case)[0].trial


_OF_THE_SUITE = ("schema", "suite", "contenders", "complete", "code")
"""Entries of `run.json` that `scores.json` says otherwise."""

_TIMES = ("steps", "step_seconds", "seconds")


def run_job(
    suite: ReproductionSuite, out: Path, executor: Executor, console: Console, traces: str = ""
) -> int:
    """Run what is missing of a suite, and write its report.

    Files of an earlier report stay whole until this one replaces them.

    Args:
        suite: what to run.
        out: folder of the results; made if need be.
        executor: where the cases run.
        console: where to print.
        traces: form of the time series that are written too; none if empty.
    Returns:
        Exit code: 0, 1 if a case failed, 130 if it was interrupted.
    """
    run = run_missing(suite, suite.entries, out, executor, console, traces)
    if not run.complete:
        return INTERRUPTED
    try:
        results = _reported(suite, run, out, executor, console)
        print_summary(results, out / "report.html", console)
    except KeyboardInterrupt:
        say_interrupted(run, out, console)
        return INTERRUPTED
    return FAILED if results.failures else 0


def report_again(
    suite: ReproductionSuite, folder: Path, out: Path, executor: Executor, vector: bool = False
) -> Path:
    """Write the report of a run that is in a folder; nothing is scored.

    Args:
        suite: what was run.
        folder: of the run.
        out: folder of the page; may be the same.
        executor: where what the page needs beside the rows is computed.
        vector: whether every picture is written as SVG and PDF too.
    Returns:
        The page.
    Raises:
        SuiteError: not all of the suite is there.
    """
    run = _finished_run(suite, folder)
    out.mkdir(parents=True, exist_ok=True)
    write_report(_results(suite, run, folder, executor), out, vector)
    return out / "report.html"


def targets_again(suite: ReproductionSuite, folder: Path, executor: Executor) -> list[Check]:
    """Check a run that is in a folder against the suite's targets; nothing is scored.

    Args:
        suite: what was run.
        folder: of the run.
        executor: where bounds that the folder lacks are computed.
    Returns:
        The targets, with what the run got.
    Raises:
        SuiteError: not all of the suite is there.
    """
    run = _finished_run(suite, folder)
    return check_targets(_results(suite, run, folder, executor, pictures=False))


def _finished_run(suite: ReproductionSuite, folder: Path) -> SuiteRun:
    """The whole run in a folder.

    Raises:
        SuiteError: not all of the suite is there.
    """
    todo, info = pending_cases(suite, suite.entries, folder), read_run(folder)
    if todo.missing or not info.get("complete"):
        raise SuiteError(
            f"{folder} lacks {len(todo.missing)} of {len(todo.cases)} cases of suite {suite.name}; "
            f"run them: python -m benchmarks run --suite {suite.source} --out {folder}"
        )
    check_run(folder, info, suite.source)
    return SuiteRun(todo, list(todo.known.values()), info, 0.0, complete=True)


def _reported(
    suite: ReproductionSuite, run: SuiteRun, out: Path, executor: Executor, console: Console
) -> Results:
    """The results of a run, with their report."""
    run.info["cases_reused"] = len(run.todo.known)
    with console.status("driving the trials that are drawn, computing the achievable bounds"):
        results = _results(suite, run, out, executor)
    run.finish(out)
    results = replace(results, info={**results.info, "wall_time_s": run.info["wall_time_s"]})
    with console.status("writing the report"):
        write_report(results, out)
    return results


def _results(
    suite: ReproductionSuite,
    run: SuiteRun,
    folder: Path,
    executor: Executor,
    pictures: bool = True,
) -> Results:
    """What the report is made of: scores, bounds, and, if wanted, the trials that it draws.

    Raises:
        KeyboardInterrupt: Ctrl-C; bounds that are done stay in the folder.
    """
    scores = scores_of(suite, run.rows)
    failed = {score.case.name for score in scores if score.failure}
    pictured = pictured_trials(suite, run.todo, failed, executor) if pictures else {}
    pressures = suite.pressures_kpa.get("rotation", ())
    bounds = Bounds(suite.models[0], folder)
    failures, complete = bounds.compute([("rotation", p) for p in pressures], executor)
    known = {p: bound for p in pressures if (bound := bounds.known("rotation", p)) is not None}
    if not complete:
        raise KeyboardInterrupt
    reasons = {pressure: why for (_, pressure), why in failures.items()}
    return Results(suite, scores, _info(run, scores), known, reasons, pictured)


def _info(run: SuiteRun, scores: Sequence[Score]) -> dict[str, Any]:
    """What the report says of a run: how it was made, and how fast its cases were."""
    last = next(iter(run.info["contenders"].values()))
    info = {name: value for name, value in run.info.items() if name not in _OF_THE_SUITE}
    info |= {name: last[name] for name in ("command", "started")}
    times = [score.times for score in scores if score.times]
    steps, inside, whole = (sum(each[name] for each in times) for name in _TIMES)
    return info | {
        "environment_steps": steps,
        "environment_steps_per_second": steps / inside if inside else 0.0,
        "case_steps_per_second": steps / whole if whole else 0.0,
    }
