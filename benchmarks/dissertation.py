"""The dissertation's voltage profiles, studies and feed-forward voltages, computed again.

`python -m benchmarks profiles` recomputes tables I4-I20, `studies` the regressions and variance
tables, `voltages` writes a feed-forward's voltages for a real rig.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from benchmarks.files import csv_text, write_text
from controllers import CONTROLLERS
from pma_gym.cli.terminal import terminal_table
from pma_gym.data.serres2008 import load_table
from pma_gym.envs import PMAEnv
from pma_gym.pages.document import TextTable
from pma_gym.studies import VERDICTS, Comparison, compare_all
from pma_gym.studies.recursion import PROFILES
from pma_gym.studies.voltage_profile import voltage_profile
from pma_gym.terminal import SafeConsole
from pma_gym.units import SI_FACTORS

FEEDFORWARDS = ("serres_replay", "serres_feedforward", "improved_feedforward")
"""Controllers that need no sensor, so that their voltages are known before the trial."""


@dataclass(frozen=True)
class Order:
    """Request for voltages.

    Attributes:
        controller: one of `FEEDFORWARDS`.
        task: name of a task, `displacement` or another.
        pressure_kpa: gauge pressure that the trial begins at (kPa).
        rate_hz: rows a second (Hz).
        model: nominal model, a shipped name or a TOML file.
    """

    controller: str
    task: str
    pressure_kpa: float
    rate_hz: float = 100.0
    model: str = "station"


def run_voltages(order: Order, out: Path) -> int:
    """Write a feed-forward's voltages as CSV: whole or not at all.

    The first row is the rest to settle at before the trial. Every voltage is to be held from its
    row's time until that of the next; the last row ends the trial.

    Args:
        order: which.
        out: CSV file that `pma-gym simulate --interpolation zoh` takes.
    Returns:
        The number of rows.
    Raises:
        ValueError: a controller that needs sensors, an unknown task, a pressure or rate out of
            range, or what the controller cannot compute; with the fix.
    """
    environment = _environment(order)
    rows = list(_rows(order, environment))
    unit = environment.task.schedule.unit
    comment = (
        f"# {order.controller}, {order.task}, {order.pressure_kpa:g} kPa, {order.rate_hz:g} Hz, "
        f"model {environment.nominal_plant.model.name}\n"
        "# Settle at the first row; hold each row until the next "
        "(pma-gym simulate --interpolation zoh)\n"
    )
    header = ("time_s", "motor_voltage_v", "regulator_voltage_v", f"reference_{unit}")
    write_text(out, comment + csv_text([header, *rows]))
    return len(rows)


def _environment(order: Order) -> PMAEnv:
    """The environment of the trial, begun.

    Raises:
        ValueError: see `run_voltages`.
    """
    if order.controller not in FEEDFORWARDS:
        known = order.controller in CONTROLLERS
        why = "needs feedback at every step" if known else "is unknown"
        raise ValueError(
            f"--controller must be a feed-forward, whose voltages are known before the trial: "
            f"{', '.join(FEEDFORWARDS)}; {order.controller!r} {why}"
        )
    environment = PMAEnv(
        order.task,
        model=order.model,
        pressure_kpa=order.pressure_kpa,
        control_rate_hz=order.rate_hz,
        noise=False,
    )
    environment.reset(seed=0)
    return environment


def _rows(order: Order, environment: PMAEnv) -> Iterator[tuple[str, ...]]:
    """Rows as text: time (s), motor and regulator voltage (V), reference in the task's unit."""
    task, period = environment.task, environment.options.period
    unit = SI_FACTORS[task.schedule.unit]
    controller = CONTROLLERS[order.controller]()
    controller.reset(environment.reference, environment.station)
    motor, regulator = environment.motor_voltage, environment.regulator_voltage
    yield _row(-period, motor, regulator, environment.reference(0.0) / unit)
    for step in range(task.steps(order.rate_hz) + 1):
        # Open loop: the reading at rest is all it could ever have seen.
        if step < task.steps(order.rate_hz):
            volts = min(max(controller.act(environment.measurement, step * period), 0.0), 10.0)
            if task.actuator == "motor":
                motor = volts
            else:
                regulator = volts
        yield _row(step * period, motor, regulator, environment.reference(step * period) / unit)


def _row(time: float, motor: float, regulator: float, reference: float) -> tuple[str, ...]:
    return f"{time:.9g}", f"{motor:.6f}", f"{regulator:.6f}", f"{reference:.6g}"


PROFILE_COLUMNS = (
    "table",
    "task",
    "pressure_kpa",
    "time_s",
    "y_desired_m",
    "x_input_m",
    "motor_voltage_v",
)
"""Columns of the file, those of the shipped tables I4-I20."""

# Decimals of the voltage in print, by table; 5 in the others.
_VOLTAGE_DECIMALS = {"I4": 6, "I5": 6, "I7": 6, "I8": 6, "I9": 6, "I17": 4, "I18": 6, "I20": 6}


def run_profiles(out: Path) -> int:
    """Write the 17 profiles, 842 rows, with the digits of the print.

    Args:
        out: CSV file; written whole or not at all.

    Returns:
        The number of rows.
    """
    rows = [row for table in PROFILES for row in _profile_rows(table)]
    write_csv(out, PROFILE_COLUMNS, rows)
    return len(rows)


def _profile_rows(table: str) -> Iterator[tuple[str, ...]]:
    printed = load_table(table)
    task, pressure = str(printed["task"][0]), float(printed["pressure_kpa"][0])
    decimals = _VOLTAGE_DECIMALS.get(table, 5)
    for time, position, x_input, voltage in zip(*voltage_profile(task, pressure), strict=True):
        yield (
            *(table, task, f"{pressure:g}", f"{time:g}"),
            *(_shortest(position, 4), _spreadsheet(x_input), _shortest(voltage, decimals)),
        )


def _shortest(value: float, decimals: int) -> str:
    """A figure without zeros at its end: 0.0, 0.12."""
    return str(round(float(value), decimals))


def _spreadsheet(value: float) -> str:
    """A figure in the eleven characters of the spreadsheet that the tables come from."""
    if 0.0 < abs(value) < 1e-4:
        return repr(float(f"{value:.5e}"))
    return _shortest(value, 9)


def write_csv(out: Path, columns: tuple[str, ...], rows: list[tuple[str, ...]]) -> None:
    """Write a CSV file whole or not at all.

    Args:
        out: the file; its folder is made.
        columns: header.
        rows: cells as text.
    """
    write_text(out, csv_text([columns, *rows]))


COLUMNS = ("study", "table", "quantity", "printed", "recomputed", "verdict", "note")
"""Columns of the CSV file."""

_STYLES = {"equal": "green", "rounded": "yellow", "wrong in print": "bold red"}


def run_studies(out: Path | None = None, console: Console | None = None) -> list[Comparison]:
    """Print every comparison by study, and the counts; write them as CSV if asked.

    Args:
        out: CSV file with every comparison; written whole or not at all.
        console: where to print; standard output by default.

    Returns:
        The comparisons.
    """
    console = console or SafeConsole()
    rows = compare_all()
    for study, group in _by_study(rows).items():
        notes = _notes(group)
        console.print(study_table(study, group, notes))
        for note, number in notes.items():
            console.print(f"{number}: {note}", markup=False, highlight=False)
        console.print()
    console.print(terminal_table(counts_table(rows)))
    if out is not None:
        write_csv(out, COLUMNS, [_cells(row) for row in rows])
        console.print(f"{len(rows)} comparisons in {out}")
    return rows


def _by_study(rows: Sequence[Comparison]) -> dict[str, list[Comparison]]:
    """The comparisons of each study, studies in the order in which they first appear."""
    studies: dict[str, list[Comparison]] = {}
    for row in rows:
        studies.setdefault(row.study, []).append(row)
    return studies


def _notes(rows: Sequence[Comparison]) -> dict[str, int]:
    """Each note once, numbered from 1."""
    return {note: i for i, note in enumerate(dict.fromkeys(r.note for r in rows if r.note), 1)}


def study_table(study: str, rows: Sequence[Comparison], notes: Mapping[str, int]) -> Table:
    """One study's comparisons as a table for the terminal, as narrow as 80 columns.

    Args:
        study: its name.
        rows: its comparisons.
        notes: numbers of the notes, whose text stands below the table.
    """
    table = Table(title=f"{study}: {_summary(rows)}", title_justify="left", expand=False)
    for name in COLUMNS[1:]:
        right = name in ("printed", "recomputed", "note")
        table.add_column(
            name,
            justify="right" if right else "left",
            no_wrap=name != "quantity",
            overflow="fold",
        )
    for row in rows:
        style = _STYLES[row.verdict]
        _, *cells, verdict, note = _cells(row)
        table.add_row(*cells, Text(verdict, style), str(notes.get(note, "")))
    return table


def counts_table(rows: Sequence[Comparison]) -> TextTable:
    """Count figures of each study that are equal, rounded and misprinted."""
    studies = [*_by_study(rows).items(), ("all", rows)]
    cells = [[study, *_counts(group)] for study, group in studies]
    return TextTable("All studies", ("Study", *VERDICTS), cells)


def _counts(rows: Sequence[Comparison]) -> list[str]:
    counts = Counter(row.verdict for row in rows)
    return [str(counts[verdict]) for verdict in VERDICTS]


def _summary(rows: Sequence[Comparison]) -> str:
    numbers = zip(_counts(rows), VERDICTS, strict=True)
    return ", ".join(f"{count} {verdict}" for count, verdict in numbers if count != "0")


def _cells(row: Comparison) -> tuple[str, ...]:
    figure = f"{row.recomputed:.9g}"
    return (row.study, row.table, row.quantity, row.printed, figure, row.verdict, row.note)
