"""The main job: run a suite, write its results, say how it went."""

import shlex
import shutil
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, replace
from datetime import UTC, datetime
from pathlib import Path

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
)

from benchmarks.executors.executor import Executor
from benchmarks.files import write_bytes, write_text
from benchmarks.reproduction.execution import Execution, compile_models, execute
from benchmarks.reproduction.page import report_blocks, report_pictures
from benchmarks.reproduction.replay import all_replay_errors
from benchmarks.reproduction.results import Results, csv_text, json_text
from benchmarks.reproduction.rotation_reading import entries
from benchmarks.reproduction.summary import print_failures, print_summary
from benchmarks.reproduction.targets import check_targets
from benchmarks.runner.environment_info import environment_info
from benchmarks.suites.reproduction import Suite
from pma_gym.pages.document import to_html, to_markdown

PLOTS = "plots"
PARTIAL = "partial"
FAILED, INTERRUPTED = 1, 130
"""Exit codes."""


def run_job(suite: Suite, out: Path, executor: Executor, console: Console) -> int:
    """Run every case of a suite and write scores and report.

    Files of an earlier run stay whole until this one ends and replaces them. Ctrl-C drops the cases
    in progress and writes those that are done to `partial/` in the same folder.

    Args:
        suite: what to run.
        out: folder of the results; made if need be.
        executor: where the cases run.
        console: where to print.
    Returns:
        Exit code: 0, 1 if a case failed, 130 if it was interrupted.
    Raises:
        KeyboardInterrupt: Ctrl-C before the cases began: nothing is written.
    """
    began = time.perf_counter()
    info = environment_info() | {
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": shlex.join(["python", "-m", "benchmarks", *sys.argv[1:]]),
        "jobs": executor.jobs,
    }
    # Now, so that a folder that cannot be made ends the job before it has run.
    out.mkdir(parents=True, exist_ok=True)
    console.print(_greeting(suite, out, executor.jobs), highlight=False)
    with console.status("compiling the models"):
        compile_models(suite)
    with _progress(console) as progress:
        execution = execute(suite, executor, _advance(progress, suite))
    info |= _speed(execution)
    if not execution.complete:
        info["wall_time_s"] = time.perf_counter() - began
        return _leave_partial(Results(suite, execution, info), out, console)
    try:
        with console.status("writing the report"):
            results = _write_results(Results(suite, execution, info), out, began)
    except KeyboardInterrupt:
        return _leave_partial(Results(suite, execution, info), out, console)
    try:
        print_summary(results, out / "report.html", console)
    except KeyboardInterrupt:
        console.print(f"Interrupted when all was done: the report is in {out}.", highlight=False)
        return INTERRUPTED
    return FAILED if results.failures else 0


def _greeting(suite: Suite, out: Path, jobs: int) -> str:
    count = len(list(suite.cases()))
    words = f"Suite {suite.name} version {suite.version}: {count} cases, {jobs} at a time"
    if (out / "scores.json").exists():
        words += f"\nstarting fresh; the earlier results in {out} are replaced when this ends"
    if (out / PARTIAL).exists():
        words += f"\nan interrupted run's {out / PARTIAL} is not used"
    return words


def _progress(console: Console) -> Progress:
    return Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.fields[last]}", markup=False),
        console=console,
    )


def _advance(progress: Progress, suite: Suite) -> Callable[[str, bool], None]:
    """A bar that a finished case moves on, and a count of those that failed."""
    total = len(list(suite.cases())) + len(suite.pressures_kpa.get("rotation", ()))
    bar = progress.add_task("cases and bounds", total=total, last="")
    failures = 0

    def done(name: str, failed: bool) -> None:
        nonlocal failures
        failures += failed
        words = f" ({failures} failed)" if failures else ""
        progress.update(bar, advance=1, last=name + words)

    return done


def _speed(execution: Execution) -> dict[str, float]:
    """Control steps in all, and a second: of the environment alone, and of whole cases."""
    scores = [outcome.score for outcome in execution.outcomes if not outcome.score.failure]
    steps = sum(score.steps for score in scores)
    inside = sum(score.step_seconds for score in scores)
    whole = sum(score.seconds for score in scores)
    return {
        "environment_steps": steps,
        "environment_steps_per_second": steps / inside if inside else 0.0,
        "case_steps_per_second": steps / whole if whole else 0.0,
    }


def _write_results(results: Results, out: Path, began: float) -> Results:
    """Write everything; the results with the time that they took."""
    pictures = report_pictures(results)
    info = dict(results.info)
    # What is left to do takes a fraction of a second.
    info["wall_time_s"] = time.perf_counter() - began
    results = replace(results, info=info)
    checks = check_targets(results)
    blocks = report_blocks(results, checks)
    texts = {
        "report.md": to_markdown(blocks, pictures, PLOTS),
        "report.html": to_html(blocks, pictures),
        "scores.csv": csv_text(results.scores),
    }
    replay = [
        asdict(error)
        for errors in all_replay_errors(results, results.suite.models[0]).values()
        for error in errors
    ]
    targets = [asdict(check) | {"verdict": check.verdict} for check in checks]
    texts["scores.json"] = json_text(
        results,
        targets=targets,
        replay_errors=replay,
        rotation_reading=entries(results.suite.models[0]) if replay else [],
    )
    # All is computed before anything is replaced, so that no folder mixes two runs.
    shutil.rmtree(out / PLOTS, ignore_errors=True)
    for name, image in pictures.items():
        write_bytes(out / PLOTS / f"{name}.png", image)
    for name, text in texts.items():
        write_text(out / name, text)
    shutil.rmtree(out / PARTIAL, ignore_errors=True)
    return results


def _leave_partial(results: Results, out: Path, console: Console) -> int:
    """Write the scores of an interrupted run beside the last whole run's, and say so."""
    folder = out / PARTIAL
    if not results.scores:
        console.print(
            "Interrupted before the first case was done: nothing was measured, and "
            f"nothing is written to {out}. Run again for the whole.",
            highlight=False,
        )
        return INTERRUPTED
    write_text(folder / "scores.csv", csv_text(results.scores))
    write_text(folder / "scores.json", json_text(results))
    total = len(list(results.suite.cases()))
    console.print(
        f"Interrupted: {len(results.scores)} of {total} cases are done; their scores "
        f"are in {folder}. There is no report of a part; run again for the whole.",
        highlight=False,
    )
    print_failures(results, console)
    return INTERRUPTED
