"""`python -m benchmarks suites`: what can be run."""

from rich.console import Console
from rich.table import Table

from benchmarks.runner.case import cases
from benchmarks.suites.frozen import frozen_suite, suite_names
from benchmarks.suites.suite import FrozenSuite


def print_suites(console: Console) -> None:
    """A table of the suites and of who is compared on them."""
    table = Table("suite", "version", "stations", "episodes", "cases", "tasks")
    frozen = [frozen_suite(name) for name in suite_names()]
    for suite in frozen:
        table.add_row(
            suite.name,
            str(suite.version),
            str(len(suite.stations)),
            str(len(suite.episodes)),
            str(len(cases(suite, suite.entries))),
            str(len(suite.tasks)),
        )
    console.print(table)
    for suite in frozen:
        names = ", ".join(entry.spec.name for entry in suite.entries)
        console.print(f"{suite.name}: {suite.title} ({_control(suite)})", highlight=False)
        console.print(f"  tasks: {', '.join(suite.tasks)}", highlight=False)
        console.print(f"  controllers: {names}", highlight=False)


def suite_documents() -> list[dict[str, object]]:
    """The frozen suites for programs: version, size, tasks and controllers."""
    return [
        {
            "name": suite.name,
            "version": suite.version,
            "title": suite.title,
            "stations": len(suite.stations),
            "episodes": len(suite.episodes),
            "cases": len(cases(suite, suite.entries)),
            "tasks": list(suite.tasks),
            "controllers": [entry.spec.name for entry in suite.entries],
            "control_rate_hz": suite.control_rate_hz,
        }
        for suite in map(frozen_suite, suite_names())
    ]


def _control(suite: FrozenSuite) -> str:
    """Rate and delays, for people."""
    words = [f"{suite.control_rate_hz:g} Hz"]
    for name, what in (("action_delay_s", "commands"), ("observation_delay_s", "readings")):
        delay = suite.environment.get(name, 0.0)
        words += [f"{what} {1e3 * delay:g} ms late"] if delay else []
    return ", ".join(words)
