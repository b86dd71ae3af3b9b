"""`python -m benchmarks exercise`: tables, picture and report of the exercise device.

A `Choice` has the configurations to show and search: given values, common sizes for the rest.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

from rich.console import Console

from benchmarks.dissertation import write_csv
from benchmarks.exercise.profile import Answer, Prescription, answer
from benchmarks.exercise.tables import (
    check_table,
    exercise_plot,
    knee_table,
    makers_table,
    range_table,
)
from benchmarks.files import write_bytes, write_text
from pma_gym.cli.terminal import terminal_table
from pma_gym.pages.document import (
    Block,
    Callout,
    Heading,
    Paragraph,
    Picture,
    TextTable,
    to_html,
    to_markdown,
)
from pma_gym.plant.exercise_device.device import (
    FULL_ANGLE,
    RADIUS,
    Device,
    MusclesError,
    muscles,
    own_device,
    pressure_grid,
    resistive_moment,
)
from pma_gym.plant.exercise_device.knee import BODY_HEIGHT, BODY_MASS, dissertations_knee_peak
from pma_gym.plant.model import Model, load_model
from pma_gym.units import parse_numbers

SEARCHED = {"muscles": range(1, 7), "diameter": (10, 20, 40), "length": (150, 200, 250, 300, 400)}
"""Numbers, diameters and lengths (mm) among which the smallest is sought: the diameters are those
that Festo has (Serres 2008, 1.2.1.4), the others our choice."""

SHOWN = {"muscles": (1, 2, 3), "diameter": (10, 20, 40), "length": (250,)}
"""The same for the tables and the picture, where nothing else is asked for."""


class ChoiceError(ValueError):
    """Options that cannot be used; says which, the rule and the fix."""


@dataclass(frozen=True)
class Choice:
    """The options as given: numbers by commas, or empty.

    Attributes:
        muscles: how many.
        diameter: of each (mm).
        length: of each (mm).
        radius: of the pulley (mm).
    """

    muscles: str = ""
    diameter: str = ""
    length: str = ""
    radius: str = ""

    def shown(self, model: Model) -> list[Device]:
        """The configurations of tables and picture, smallest first.

        Raises:
            ChoiceError: no number, or one out of bounds.
        """
        return self._devices(model, SHOWN)

    def searched(self, model: Model) -> list[Device]:
        """The configurations that a prescription chooses from; errors as `shown`."""
        return self._devices(model, SEARCHED)

    def _devices(self, model: Model, common: dict) -> list[Device]:
        defaults = {**common, "radius": (RADIUS.from_si(own_device(model).radius),)}
        options = [
            numbers(name, getattr(self, name)) or default for name, default in defaults.items()
        ]
        try:
            return sorted({_device(*each) for each in product(*options)})
        except MusclesError as error:
            raise ChoiceError(f"--{error}") from None


def _device(number: float, diameter: float, length: float, radius: float) -> Device:
    try:
        RADIUS.check("radius", radius)
    except ValueError as error:
        raise ChoiceError(f"--{error}") from None
    return Device(muscles(number, diameter, length), RADIUS.to_si(radius))  # type: ignore[arg-type]


def numbers(option: str, text: str) -> list[float]:
    """The numbers of an option; none if it is empty.

    Args:
        option: its name, for messages.
        text: as given.
    Raises:
        ChoiceError: something in it is no number.
    """
    values = parse_numbers(text)
    if values is None:
        raise ChoiceError(
            f"--{option} must be a number, or several by commas, got {text!r}; for example "
            f"--{option} {'1,2' if option == 'muscles' else '20,40'}"
        )
    return values


PICTURE = "exercise"

_CHECK = (
    "The static moment of the station's model beside what table I3's load cell read, times the "
    "pulley's radius (mean of three repeats, on the line between the loads whose rotations enclose "
    "90 deg). The model was fitted to this table. Table 23 does not follow from it at any one "
    "radius and is shown, not used."
)
_RANGES = (
    "Configuration: number x diameter x length (mm), radius of the pulley (mm). **Constant**: the "
    "cable is set at the pressure of the trial, as in the dissertation; then the moment at 90 deg "
    "varies little, for a higher pressure also contracts the muscle further before the leg moves. "
    "**Set once**: the cable is set at the lowest pressure at which 90 deg stays within the "
    "resting length; then the pressure, 150–575 kPa, may follow the angle. **Scaled**: from the "
    "tested muscle by the geometric law, n (d / d0)² at equal strain, each muscle on a cable as "
    "much stiffer than the station's as it is stronger. That is an extrapolation."
)
_MAKERS = (
    "Figures of the dissertation, and of catalogues, beside the scaled ones; nothing is tuned."
)


def exercise_blocks(model: Model, devices: Sequence[Device], answer: Answer | None) -> list[Block]:
    """The whole report.

    Args:
        model: of the station.
        devices: whose ranges are shown.
        answer: a prescription's answer, or None.
    """
    blocks: list[Block] = [Heading("The resistive exercise device", 1)]
    if answer is not None:
        blocks.append(Callout(answer.text, answer.how, "good"))
    return [
        *blocks,
        Picture(PICTURE, "Moment at 90 deg by constant pressure; moment over the angle."),
        *(Heading("Configurations"), Paragraph(_RANGES), range_table(model, devices)),
        *(Heading("The tested muscle"), Paragraph(_CHECK), check_table(model)),
        *(Heading("The knee"), Paragraph(_knee_text()), knee_table(model)),
        *(Heading("Other sizes"), Paragraph(_MAKERS), makers_table(model)),
    ]


def _knee_text() -> str:
    return (
        "Largest voluntary isometric torque of a man of 18–25 years after Anderson, Madigan and "
        f"Nussbaum 2007 (its table 3 as RBDL has it; the paper was not read), {BODY_MASS:g} kg and "
        f"{BODY_HEIGHT:g} m (assumption). The dissertation (6.3) says that its largest moment is "
        "about 20 % of the knee's largest, without a torque over angle: "
        f"{dissertations_knee_peak():.0f} N m."
    )


MODEL = "station"
PLOTS = "plots"
COLUMNS = (
    *("muscles", "diameter_mm", "length_mm", "radius_mm", "pressure_kpa"),
    *("moment_nm", "contraction_mm", "allowed"),
)
"""Columns of `moments.csv`: the moment at 90 deg at constant pressure."""


def run_exercise(
    choice: Choice, prescription: Prescription | None, out: Path, console: Console
) -> Answer | None:
    """Print the tables and write report, picture and figures.

    Args:
        choice: the configurations.
        prescription: the prescription, or None.
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
    smallest = answer(model, choice.searched(model), prescription) if prescription else None
    devices = sorted({*shown, smallest.device}) if smallest else shown
    blocks = exercise_blocks(model, devices, smallest)
    for block in blocks:
        if isinstance(block, TextTable):
            console.print(terminal_table(block), "")
    if smallest:
        console.print(f"{smallest.text}. {smallest.how}", highlight=False)
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
        moments = resistive_moment(model, device, pressure, FULL_ANGLE)
        for p, moment, x, allowed in zip(pressure, *moments, strict=True):
            figures = (f"{1e-3 * p:g}", f"{moment:.6g}", f"{1e3 * x:.6g}", f"{allowed:d}")
            rows.append((*place, *figures))
    return rows
