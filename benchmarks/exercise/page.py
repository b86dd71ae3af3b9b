"""The report of the exercise device: what stands in it, in which order, with which words."""

from collections.abc import Sequence

from benchmarks.exercise.answer import Answer
from benchmarks.exercise.tables import check_table, knee_table, makers_table, range_table
from pma_gym.pages.document import Block, Callout, Heading, Paragraph, Picture
from pma_gym.plant.exercise_device.device import Device
from pma_gym.plant.exercise_device.knee import BODY_HEIGHT, BODY_MASS, dissertations_knee_peak
from pma_gym.plant.model import Model

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
        blocks.append(Callout(answer.words, answer.how, "good"))
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
