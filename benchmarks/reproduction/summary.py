"""Summary in the terminal at the end of a run."""

from pathlib import Path

from rich.console import Console
from rich.table import Table

from benchmarks.reproduction.results import Results
from benchmarks.reproduction.tables import summary_table
from pma_gym.pages.document import TextTable


def print_summary(results: Results, report: Path, console: Console) -> None:
    """Tables 22 and 30 condensed, the speed, and where the report is."""
    console.print(_shown(summary_table(results)))
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


def _shown(text: TextTable) -> Table:
    table = Table(text.header[0], title=text.title, title_justify="left")
    for name in text.header[1:]:
        table.add_column(name.replace(" (", "\n("), justify="right")
    for row in text.rows:
        table.add_row(*row)
    return table
