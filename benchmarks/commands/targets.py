"""The maintainers' check of a run: a user's report shows results, not what was aimed at."""

from pathlib import Path
from typing import Annotated

import typer

from benchmarks.commands.options import LOCAL, RESULTS, chosen_executor, refuse
from pma_gym.cli.options import JsonOption
from pma_gym.cli.terminal import print_json, print_table


def register(app: typer.Typer) -> None:
    """Add the command to the program; its help lists only what users need."""
    app.command(hidden=True, epilog="Example: python -m benchmarks targets robust")(targets)


def targets(
    suite: Annotated[str, typer.Argument(help="Name, see `suites`, or path of a TOML file.")],
    results: Annotated[
        Path | None, typer.Option(help="Folder of the run; results/SUITE if not given.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Check a run against what its suite asks for; exit code 1 if a target is missed."""
    from benchmarks.bounds import Bounds
    from benchmarks.report.leaderboard import read_leaderboard
    from benchmarks.report.tables import verdict_table
    from benchmarks.reproduction.job import targets_again
    from benchmarks.reproduction.targets import target_table
    from benchmarks.suites.frozen import frozen_suite
    from benchmarks.suites.reproduction import ReproductionSuite
    from benchmarks.suites.suite import SuiteError

    try:
        frozen = frozen_suite(suite)
        folder = results or RESULTS / frozen.name
        if isinstance(frozen, ReproductionSuite):
            checks = targets_again(frozen, folder, chosen_executor(LOCAL, 2))
            table = target_table(checks, frozen.models[0])
        else:
            with Bounds(frozen.model, folder) as bounds:
                checks = read_leaderboard(frozen, folder, bounds).verdicts
            table = verdict_table(checks)
    except SuiteError as error:
        refuse(error)
    documents = [check.document() for check in checks]
    if as_json:
        print_json(documents)
    else:
        print_table(table)
    raise typer.Exit(1 if any(each["verdict"] == "missed" for each in documents) else 0)
