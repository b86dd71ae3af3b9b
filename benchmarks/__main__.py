"""`python -m benchmarks`: the main job, and the other jobs as subcommands."""

import os
import sys
from pathlib import Path
from typing import Annotated, NoReturn

import typer

from benchmarks.exercise.commands import register as register_exercise
from benchmarks.training.commands import register as register_training

# Figures are drawn to files; each process computes on its own core.
os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("OMP_NUM_THREADS", "1")

RESULTS = Path("results")
INTERRUPTED = 130
"""Exit code after Ctrl-C, as shells have it."""


def _writable(out: Path | None) -> Path | None:
    """Refuse a file that cannot be written before anything is computed for it."""
    from pma_gym.files import OutputError, check_output

    try:
        if out is not None:
            check_output(out)
    except OutputError as error:
        _refuse(ValueError(f"--out: {error}"))
    return out


app = typer.Typer(
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    invoke_without_command=True,
)

_OUT = typer.Option(help="File to write, in a folder that exists.", callback=_writable)
Out = Annotated[Path, _OUT]
OptionalOut = Annotated[Path | None, _OUT]
Jobs = Annotated[int, typer.Option(min=1, help="Processes.")]


@app.callback()
def reproduction(
    context: typer.Context,
    out: Annotated[Path, typer.Option(help="Folder of the results.")] = RESULTS / "reproduction",
    controllers: Annotated[
        str, typer.Option(help="Names or path/to/file.py:ClassName, by commas; all if empty.")
    ] = "",
    model: Annotated[
        str,
        typer.Option(help="Models by commas: shipped names or TOML files; the suite's if empty."),
    ] = "",
    task: Annotated[str, typer.Option(help="displacement or rotation; both if empty.")] = "",
    pressures: Annotated[str, typer.Option(help="Pressures in kPa by commas; all if empty.")] = "",
    jobs: Jobs = 2,
) -> None:
    """Run every controller through every trial and write the report (the main job)."""
    if context.invoked_subcommand is not None:
        return
    try:
        code = _reproduce(out, controllers, model, task, pressures, jobs)
    except KeyboardInterrupt:
        print("Interrupted before the first case: nothing is measured or written", file=sys.stderr)
        code = INTERRUPTED
    raise typer.Exit(code)


def _reproduce(
    out: Path, controllers: str, model: str, task: str, pressures: str, jobs: int
) -> int:
    """The main job; its exit code."""
    from rich.console import Console

    from benchmarks.contender import ControllerError, parse_contenders
    from benchmarks.job import run_job
    from benchmarks.suite import SuiteError, load_suite
    from pma_gym.plant.model import ModelError, load_model

    suite = load_suite()
    try:
        models = _listed(model)
        for name in models or suite.models:
            load_model(name)
        chosen = parse_contenders(controllers, suite.controllers) if controllers else []
        suite = suite.select(models, chosen, _listed(task), _pressures(pressures))
        if out.exists() and not out.is_dir():
            raise SuiteError(f"--out {out} is a file; name a folder for the results")
    except (ControllerError, ModelError, SuiteError) as error:
        _refuse(error)
    return run_job(suite, out, jobs, Console())


@app.command()
def run(
    suite: Annotated[str, typer.Option(help="Name, see `suites`, or path of a TOML file.")],
    controllers: Annotated[
        str, typer.Option(help="Names or path/to/file.py:ClassName, by commas; or all.")
    ] = "all",
    jobs: Jobs = 2,
    out: Annotated[
        Path | None, typer.Option(help="Folder of the results; results/SUITE if not given.")
    ] = None,
) -> None:
    """Compare controllers on a frozen suite; an interrupted run goes on where it stopped."""
    from rich.console import Console

    from benchmarks.comparison.job import chosen, run_comparison
    from benchmarks.comparison.suite import frozen_suite
    from benchmarks.contender import ControllerError
    from benchmarks.suite import SuiteError

    try:
        if suite == "reproduction":
            every = "" if controllers == "all" else controllers
            raise typer.Exit(_reproduce(out or RESULTS / suite, every, "", "", "", jobs))
        frozen = frozen_suite(suite)
        entries = chosen(frozen, controllers)
        code = run_comparison(frozen, entries, out or RESULTS / frozen.name, jobs, Console())
    except (ControllerError, SuiteError) as error:
        _refuse(error)
    except KeyboardInterrupt:
        print("Interrupted before the first case; run it again", file=sys.stderr)
        code = INTERRUPTED
    raise typer.Exit(code)


@app.command()
def report(
    suite: Annotated[str, typer.Argument(help="Name, see `suites`, or path of a TOML file.")],
    results: Annotated[
        Path | None, typer.Option(help="Folder of the run; results/SUITE if not given.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder of the page; that of the run if not given.")
    ] = None,
) -> None:
    """Write a suite's leaderboard from the journal of its run."""
    from benchmarks.comparison.publish import run_report
    from benchmarks.comparison.suite import frozen_suite
    from benchmarks.suite import SuiteError

    try:
        frozen = frozen_suite(suite)
        folder = results or RESULTS / frozen.name
        print(f"Report: {run_report(frozen, folder, out or folder)}")
    except SuiteError as error:
        _refuse(error)


@app.command()
def add(
    controller: Annotated[str, typer.Argument(help="path/to/file.py:ClassName")],
    suite: Annotated[str, typer.Option(help="Suites by commas; all but `many` if empty.")] = "",
    jobs: Jobs = 2,
    results: Annotated[
        Path, typer.Option(help="Folder with a folder of results for each suite.")
    ] = RESULTS,
) -> None:
    """Score your own controller on all suites, and say where it stands or what to mend."""
    from rich.console import Console

    from benchmarks.comparison.add import own_contender, run_add
    from benchmarks.comparison.suite import frozen_suite, suite_names
    from benchmarks.contender import ControllerError
    from benchmarks.suite import SuiteError

    try:
        frozen = [frozen_suite(name) for name in _listed(suite) or suite_names()]
        frozen = [one for one in frozen if suite or not one.only_by_name]
        code = run_add(own_contender(controller), frozen, results, jobs, Console())
    except (ControllerError, SuiteError) as error:
        _refuse(error)
    except KeyboardInterrupt:
        print("Interrupted before the first case; run it again", file=sys.stderr)
        code = INTERRUPTED
    raise typer.Exit(code)


@app.command()
def suites() -> None:
    """List the frozen suites: their versions, cases and controllers."""
    from rich.console import Console

    from benchmarks.comparison.listing import print_suites

    print_suites(Console())


@app.command()
def profiles(out: Out) -> None:
    """Regenerate the dissertation's voltage profiles (tables I4-I20)."""
    from benchmarks.profiles import run_profiles

    print(f"{run_profiles(out)} rows in {out}")


@app.command()
def budget(
    out: Annotated[
        Path, typer.Option(help="Folder of tables (CSV, Markdown) and pictures.")
    ] = RESULTS / "budget",
) -> None:
    """Say why the dissertation's feed-forward misses what it misses, at every pressure."""
    from benchmarks.budget.job import run_budget

    if out.exists() and not out.is_dir():
        _refuse(ValueError(f"--out {out} is a file; name a folder for the results"))
    run_budget(out)


@app.command()
def measured(
    out: Annotated[Path, typer.Option(help="Folder of the results.")] = RESULTS / "measured",
    jobs: Jobs = 2,
    seed: Annotated[int, typer.Option(min=0, help="Seed of simulated chance.")] = 0,
    rounds: Annotated[
        int | None,
        typer.Option(min=1, help="Diagnoses, each of what the one before amended; 2 if not given."),
    ] = None,
    write: Annotated[
        Path | None,
        typer.Option(help="Write the trials to this folder, for pma-gym diagnose, and stop."),
    ] = None,
) -> None:
    """Diagnose the dissertation's tables I2 and I3; an interrupted run goes on where it stopped."""
    from benchmarks.measured.job import run_measured, write_trials
    from benchmarks.measured.rounds import MOST_ROUNDS

    for folder, option in ((out, "--out"), (write, "--write")):
        if folder is not None and folder.exists() and not folder.is_dir():
            _refuse(ValueError(f"{option} {folder} is a file; name a folder"))
    if write is not None:
        print(f"{write_trials(write)} trials in {write}")
        return
    try:
        run_measured(out, jobs, seed, rounds or MOST_ROUNDS)
    except KeyboardInterrupt:
        print(f"Interrupted; run it again, it goes on from {out / 'stages'}", file=sys.stderr)
        raise typer.Exit(INTERRUPTED) from None


@app.command()
def voltages(
    controller: Annotated[
        str, typer.Option(help="serres_replay, serres_feedforward or improved_feedforward.")
    ],
    task: Annotated[str, typer.Option(help="Name of a task, such as displacement or rotation.")],
    pressure: Annotated[float, typer.Option(help="Gauge pressure (kPa).")],
    out: Out,
    rate: Annotated[float, typer.Option(help="Rows a second (Hz), each held.")] = 100.0,
    model: Annotated[
        str, typer.Option(help="Nominal model: shipped name or TOML file.")
    ] = "station",
) -> None:
    """Write a feed-forward's voltages for a real rig as CSV."""
    from benchmarks.voltages import Order, run_voltages

    try:
        rows = run_voltages(Order(controller, task, pressure, rate, model), out)
    except ValueError as error:
        _refuse(error)
    print(f"{rows} rows in {out}")


@app.command()
def studies(out: OptionalOut = None) -> None:
    """Recompute the dissertation's regressions and variance tables beside the printed ones."""
    from benchmarks.studies import run_studies

    run_studies(out)


@app.command()
def identify(out: Out, jobs: Jobs = 2) -> None:
    """Fit the station's model from tables I2 and I3; judge it on left-out pressures and I1."""
    from benchmarks.identify import run_identify

    try:
        run_identify(out, jobs)
    except KeyboardInterrupt:
        print("Interrupted: nothing is written", file=sys.stderr)
        raise typer.Exit(INTERRUPTED) from None


@app.command()
def tune(
    out: OptionalOut = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise.")] = 0,
    model: Annotated[str, typer.Option(help="Shipped name or TOML file.")] = "station",
    jobs: Jobs = 2,
    only: Annotated[
        str, typer.Option(help="Tables by loop and kind of task, such as '50hz*/rotation'.")
    ] = "*",
) -> None:
    """Tune the gains of the PIDs on a model; without --out, the shipped table of gains."""
    from benchmarks.tune import GAINS_FILE, TuneError, run_tune

    out = out or GAINS_FILE
    _writable(out)
    try:
        written = run_tune(out, seed, model, jobs, only)
    except ValueError as error:
        _refuse(error)
    except TuneError as error:
        print(f"error: {error}", file=sys.stderr)
        raise typer.Exit(1) from None
    raise typer.Exit(0 if written else INTERRUPTED)


@app.command()
def design(
    controllers: Annotated[
        str, typer.Option(help="Names by commas; all that have settings if empty.")
    ] = "",
    out: OptionalOut = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise.")] = 0,
    jobs: Jobs = 2,
    again: Annotated[
        bool, typer.Option(help="Also what the file has already; else only what is missing.")
    ] = False,
    only: Annotated[
        str, typer.Option(help="Designs by suite and kind of task, such as 'hard/*'.")
    ] = "*",
) -> None:
    """Search the settings of controllers on training stations; without --out, the shipped file."""
    from benchmarks.design import run_design
    from controllers.designs import DESIGNS_FILE

    try:
        complete = run_design(_listed(controllers), out or DESIGNS_FILE, seed, jobs, again, only)
    except ValueError as error:
        _refuse(error)
    raise typer.Exit(0 if complete else INTERRUPTED)


@app.command()
def accuracy(out: OptionalOut = None) -> None:
    """Measure the integrator's accuracy; exit code 1 if the default step misses a limit."""
    from benchmarks.accuracy import run_accuracy

    raise typer.Exit(0 if run_accuracy(out=out) else 1)


@app.command()
def integrators(out: OptionalOut = None) -> None:
    """Compare methods of integration at equal error; --out takes their curves as CSV."""
    from benchmarks.integrators import run_integrators

    run_integrators(out=out)


@app.command()
def speed(
    json_file: Annotated[
        Path | None, typer.Option("--json", help="File for all figures, in a folder that exists.")
    ] = None,
    check: Annotated[
        bool,
        typer.Option(help="Only what shows a loss of vectorisation; exit code 1 if so."),
    ] = False,
    only: Annotated[
        str, typer.Option(help="Rows by commas, such as single or 'batch/own*'; all if empty.")
    ] = "",
    quick: Annotated[bool, typer.Option(help="A smoke run, whose figures say little.")] = False,
) -> None:
    """Measure this package's speed beside other simulators' (`make peers` installs them)."""
    from benchmarks.speed.rows import RequestError
    from benchmarks.speed.run import run_speed

    try:
        code = run_speed(json_file, check, only, quick)
    except RequestError as error:
        _refuse(error)
    raise typer.Exit(code)


@app.command("hidden-effects")
def hidden_effects(
    block: Annotated[
        str,
        typer.Option(
            help="single, faint, nothing, parameters, pair, unknown, undecidable, or all."
        ),
    ],
    n: Annotated[int, typer.Option("--n", min=1, help="Cases of a block; more extend the set.")],
    seed: Annotated[int, typer.Option(min=0, help="Same seed, same cases.")] = 0,
    jobs: Jobs = 1,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder; results/hidden_effects/BLOCK-SEED if not given."),
    ] = None,
    json_file: Annotated[
        Path | None, typer.Option("--json", help="File for all figures, in a folder that exists.")
    ] = None,
    rounds: Annotated[
        int, typer.Option(min=0, max=3, help="Experiments that follow, in block undecidable.")
    ] = 2,
    keep: Annotated[bool, typer.Option("--keep", help="Keep the trials in FOLDER/data.")] = False,
    again: Annotated[bool, typer.Option("--again", help="Anew what other code made.")] = False,
) -> None:
    """Hide effects in trials, diagnose them, count what was named right; goes on after Ctrl-C."""
    from benchmarks.hidden_effects.job import JobError, Order, ordered, run_hidden_effects

    _writable_json(json_file)
    try:
        blocks, orders = ordered(block, rounds), []
        for each in blocks:
            usual = (out or RESULTS / "hidden_effects") / f"{each.name}-{seed}"
            folder = usual if out is None or len(blocks) > 1 else out
            orders.append(Order(each, n, seed, folder, jobs, keep, again))
        code = run_hidden_effects(orders, json_file)
    except JobError as error:
        _refuse(error)
    raise typer.Exit(code)


@app.command("hidden-effects-report")
def hidden_effects_report(
    places: Annotated[
        list[Path], typer.Argument(help="Folders or --json files of `hidden-effects`.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(help="Markdown or .html file; printed if not given.", callback=_writable),
    ] = None,
) -> None:
    """Write the figures of several blocks of hidden effects as one page of tables."""
    from benchmarks.files import write_text
    from benchmarks.hidden_effects.job import JobError
    from benchmarks.hidden_effects.summary import read_scores, report

    try:
        text = report(read_scores(places), out.suffix if out else ".md")
    except JobError as error:
        _refuse(error)
    if out is None:
        print(text)
    else:
        write_text(out, text)


register_training(app)
register_exercise(app)


def _listed(text: str) -> list[str]:
    return [part.strip() for part in text.split(",") if part.strip()]


def _pressures(text: str) -> list[float]:
    from benchmarks.suite import SuiteError

    try:
        return [float(part) for part in _listed(text)]
    except ValueError:
        raise SuiteError(f"--pressures must be numbers in kPa by commas, got {text!r}") from None


def _writable_json(path: Path | None) -> None:
    """Refuse a file of figures that cannot be written before anything is computed for it."""
    from pma_gym.files import OutputError, check_output

    try:
        if path is not None:
            check_output(path)
    except OutputError as error:
        _refuse(ValueError(f"--json: {error}"))


def _refuse(error: Exception) -> NoReturn:
    """One message and exit code 2."""
    print(f"error: {error}", file=sys.stderr)
    raise typer.Exit(2)


def main() -> None:
    """The whole command; a file that cannot be written ends it with one message."""
    try:
        app(prog_name="python -m benchmarks")
    except OSError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
