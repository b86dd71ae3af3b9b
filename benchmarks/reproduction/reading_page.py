"""The report's words on the rotation trials as they may have been read: a hypothesis, marked so."""

from benchmarks.reproduction.rotation_reading import (
    CALIBRATED_DEG_PER_V,
    DECODED_DEG_PER_V,
    GAP_DEG,
    ReadTrial,
    mean_absolute_error,
    read_trials,
)
from benchmarks.runner.phase_score import PHASES
from pma_gym.pages.document import Block, Heading, Paragraph, TextTable
from pma_gym.plant.plant import Plant


def reading_blocks(model: str) -> list[Block]:
    """The rotation replay of a station, plain and through the declared reading.

    Args:
        model: a shipped name, or a TOML file.
    """
    plant = Plant(model)
    if not plant.model.rig.balances_loads:
        return []
    trials = read_trials(plant)
    return [
        Heading("A hypothesis: the rotation trials as they may have been read"),
        Paragraph(explained()),
        reading_table(trials),
    ]


def explained() -> str:
    """State what is known, what is assumed and what would decide: a sentence each."""
    return (
        "Known: the replay turns further than the tables by nearly the same angle in all three "
        "phases, while the displacement trials of the same station fit, and neither a pulley of "
        "28.65 mm nor a cable wound over itself explains both. "
        f"Assumed: the trials' potentiometer was decoded with {DECODED_DEG_PER_V:g} deg/V in place "
        f"of table 1's {CALIBRATED_DEG_PER_V:g}, read nothing over a dead gap of {GAP_DEG:g} deg, "
        "and its cable had no slack; the numbers come from outside tables 27-30, but were picked "
        "after these had been seen, so this reading is a hypothesis, no part of the plant, and "
        "nothing is fitted through it. "
        "What would decide it: one turn of the pulley by hand past the potentiometer, its volts "
        "beside the angle; until then the gap can be neither confirmed nor ruled out."
    )


def reading_table(trials: list[ReadTrial]) -> TextTable:
    """RMSE of table 30 by phase and pressure: measured, plain, and through the reading."""
    rows = [
        [
            f"{each.pressure_kpa:g}",
            *(
                f"{figures[phase].rmse:.2f}"
                for phase in PHASES["rotation"]
                for figures in (each.measured, each.plain, each.read)
            ),
        ]
        for each in trials
    ]
    header = ["Pressure (kPa)"]
    for phase in PHASES["rotation"]:
        header += [f"{phase} | {who} (deg)" for who in ("measured", "plain", "as read")]
    plain, read = (mean_absolute_error(trials, each) for each in (False, True))
    title = (
        f"Table 30's RMSE: mean absolute error {plain:.2f} deg plain, {read:.2f} deg through the "
        "declared reading"
    )
    return TextTable(title, header, rows)
