"""`python -m benchmarks exercise`: tables, picture and report of the exercise device."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from benchmarks.dissertation.profiles import write_csv
from benchmarks.exercise.answer import Answer, answer
from benchmarks.exercise.choice import Choice
from benchmarks.exercise.page import PICTURE, exercise_blocks
from benchmarks.exercise.plots import exercise_plot
from benchmarks.exercise.profile import Prescription
from benchmarks.exercise.tables import terminal_table
from benchmarks.files import write_bytes, write_text
from pma_gym.pages.document import TextTable, to_html, to_markdown
from pma_gym.plant.exercise_device.device import FULL_ANGLE, Device, pressure_grid, resistive_moment
from pma_gym.plant.model import Model, load_model

MODEL = "station"
PLOTS = "plots"
COLUMNS = (
    *("muscles", "diameter_mm", "length_mm", "radius_mm", "pressure_kpa"),
    *("moment_nm", "contraction_mm", "allowed"),
)
"""Columns of `moments.csv`: the moment at 90 deg at constant pressure."""


def run_exercise(
    choice: Choice, wanted: Prescription | None, out: Path, console: Console
) -> Answer | None:
    """Print the tables and write report, picture and figures.

    Args:
        choice: the configurations.
        wanted: the prescription, or None.
        out: folder for `report.html`, `report.md`, `moments.csv` and `plots/`.
        console: where to print.
    Returns:
        The prescription's answer, if there is a prescription.
    Raises:
        ChoiceError: options that are no sizes.
        UnreachableError: no configuration gives the prescription; nothing is written.
    """
    model = load_model(MODEL)
    shown = choice.shown(model)
    smallest = answer(model, choice.searched(model), wanted) if wanted else None
    devices = sorted({*shown, smallest.device}) if smallest else shown
    blocks = exercise_blocks(model, devices, smallest)
    for block in blocks:
        if isinstance(block, TextTable):
            console.print(terminal_table(block), "")
    if smallest:
        console.print(f"{smallest.words}. {smallest.how}", highlight=False)
    pictures = {PICTURE: exercise_plot(model, devices, smallest)}
    write_bytes(out / PLOTS / f"{PICTURE}.png", pictures[PICTURE])
    write_text(out / "report.md", to_markdown(blocks, pictures, PLOTS))
    write_text(out / "report.html", to_html(blocks, pictures))
    write_csv(out / "moments.csv", COLUMNS, _cells(model, devices))
    console.print(f"Report: {out / 'report.html'}", highlight=False)
    return smallest


def _cells(model: Model, devices: Sequence[Device]) -> list[tuple[str, ...]]:
    """Every configuration's moment at 90 deg by constant pressure."""
    pressure, rows = pressure_grid(model, 12.5e3), []
    for device in devices:
        number, *sizes = device.muscles
        place = (f"{number}", *(f"{1e3 * size:.5g}" for size in (*sizes, device.radius)))
        given = resistive_moment(model, device, pressure, FULL_ANGLE)
        for p, moment, x, allowed in zip(pressure, *given, strict=True):
            figures = (f"{1e-3 * p:g}", f"{moment:.6g}", f"{1e3 * x:.6g}", f"{allowed:d}")
            rows.append((*place, *figures))
    return rows
