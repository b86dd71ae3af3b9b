"""The rotation trials as their potentiometer may have been read: a declared hypothesis.

The replay of the rotation trials turns 9 to 14 deg further than the tables say (means of the
phases; single phases 8 to 16 deg), by nearly the same angle all along. In displacement the RMSE of
the same station is 0.31 mm off the measured one in the mean.
A reading explains it that changes nothing of the rig:

- the trials' potentiometer decoded as 5 V over its 320 deg of travel, 64 deg/V, where table 1
  calibrates it at 70.4 deg/V (0.0142 V/deg): a reading of 90 deg is then 99 deg of the pulley, and
  99 deg on its 25.9 mm are the 45 mm that the trials were designed for;
- a dead gap: the part turns 360 deg of which 340 are electrical, and what stands on the other 20
  reads nothing. Phase I as printed (a late start, then a line that is too steep) looks like one;
- no slack: step 9 of the station's manual has the excess cable wound up before a trial.

Both numbers come from outside tables 27-30. Both were picked after these tables had been seen, so
this is a hypothesis and no finding: it is never part of the plant, nothing is fitted to it or by
it, and one calibration of the potentiometer over a full turn would decide it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from statistics import fmean
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.runner.phase_score import PHASES, PhaseScore, measured_score, score_trial
from pma_gym.data.serres2008 import load_table
from pma_gym.data.trial import Trial
from pma_gym.metrics import PHASE_SAMPLES, SAMPLE_RATE_HZ
from pma_gym.pages.document import Block, Heading, Paragraph, TextTable
from pma_gym.plant.plant import Plant
from pma_gym.units import SI_FACTORS

Array = NDArray[np.float64]

DEG = SI_FACTORS["deg"]
ROTATION_TABLES = tuple(f"I{number}" for number in range(13, 21))
"""Printed voltages of the rotation trials, a pressure each."""


class RotationReading(NamedTuple):
    """Hypothetical decoding of a potentiometer.

    Attributes:
        decoded_deg_per_v: what its volts were multiplied by.
        true_deg_per_v: what they should have been multiplied by.
        gap_deg: how far the pulley turns before it reads anything.
        slack: way of the cable that is taken up before a trial (m).
    """

    decoded_deg_per_v: float
    true_deg_per_v: float
    gap_deg: float
    slack: float

    def of(self, angle: Array, radius: float) -> Array:
        """Return the readings at true angles of the pulley (rad), as the plant turns it.

        Args:
            angle: true angle with the plant's slack (rad), any shape.
            radius: of the pulley (m).
        """
        wound = np.maximum(angle - self.slack / radius, 0.0)
        factor = self.decoded_deg_per_v / self.true_deg_per_v
        return np.where(wound < self.gap_deg * DEG, 0.0, factor * wound)


def reading(gain: float, gap_deg: float, slack: float) -> RotationReading:
    """A reading by its gain on the true angle, its gap (deg) and the slack (m) taken up."""
    return RotationReading(gain * CALIBRATED_DEG_PER_V, CALIBRATED_DEG_PER_V, gap_deg, slack)


DECODED_DEG_PER_V = 64.0
"""5 V over the 320 deg of the part's travel (Serres 2008, 2.1.3: the potentiometer)."""

CALIBRATED_DEG_PER_V = 70.4
"""Table 1: V = 0.0142 deg + 0.087."""

GAP_DEG = 20.0
"""360 deg of a turn less the part's 340 electrical ones."""


def declared(plant: Plant) -> RotationReading:
    """The declared reading, with the slack that a plant has to be freed of."""
    return RotationReading(
        DECODED_DEG_PER_V, CALIBRATED_DEG_PER_V, GAP_DEG, plant.model.parameters["cable"].slack
    )


def rotation_trial(plant: Plant, table: str) -> Trial:
    """A printed rotation trial on a plant, open loop, its true motion at 384 Hz.

    Args:
        plant: a station.
        table: one of `ROTATION_TABLES`.
    """
    printed = load_table(table)
    samples = 2 * round(5.0 * SAMPLE_RATE_HZ) + PHASE_SAMPLES
    time = np.arange(samples) / SAMPLE_RATE_HZ
    pressure = float(printed["pressure_kpa"][0]) * SI_FACTORS["kPa"]
    volts = np.interp(time, printed["time_s"], printed["motor_voltage_v"])
    regulator = np.full(samples, plant.regulator_voltage(pressure))
    return plant.simulate(
        Trial(time, {"motor_voltage": volts, "regulator_voltage": regulator}), noise=False
    )


def read_trial(trial: Trial, reading: RotationReading, radius: float) -> Trial:
    """A trial whose true rotation is what a reading makes of it."""
    read = {**trial.truth, "rotation": reading.of(np.asarray(trial.truth["rotation"]), radius)}
    return Trial(trial.time, trial.commands, truth=read)


@dataclass(frozen=True)
class ReadTrial:
    """A rotation trial: measured, replayed, and the replay through the declared reading.

    Attributes:
        pressure_kpa: of the trial (kPa).
        measured: figures by phase.
        plain: of the replay.
        read: of the replay as it may have been read.
    """

    pressure_kpa: float
    measured: Mapping[str, PhaseScore]
    plain: Mapping[str, PhaseScore]
    read: Mapping[str, PhaseScore]


def read_trials(plant: Plant) -> list[ReadTrial]:
    """All rotation trials on a station, plain and through the declared reading."""
    radius, reading = plant.model.parameters["rotor"].radius, declared(plant)
    trials = []
    for table in ROTATION_TABLES:
        pressure = float(load_table(table)["pressure_kpa"][0])
        trial = rotation_trial(plant, table)
        trials.append(
            ReadTrial(
                pressure,
                {name: measured_score("rotation", name, pressure) for name in PHASES["rotation"]},
                score_trial(trial, "rotation"),
                score_trial(read_trial(trial, reading, radius), "rotation"),
            )
        )
    return trials


def mean_absolute_error(trials: list[ReadTrial], read: bool, figure: str = "rmse") -> float:
    """Mean absolute error of table 30's RMSE, or of another figure, over trials and phases (deg).

    Args:
        trials: the trials.
        read: through the declared reading; else plain.
        figure: an attribute of a `PhaseScore`.
    """
    return fmean(
        abs(getattr((each.read if read else each.plain)[phase], figure) - getattr(score, figure))
        for each in trials
        for phase, score in each.measured.items()
    )


def entries(model: str) -> list[dict[str, object]]:
    """RMSE (deg) of every rotation trial and phase on a model, for files; none for no station.

    Args:
        model: a shipped name, or a TOML file.
    """
    plant = Plant(model)
    if not plant.model.rig.balances_loads:
        return []
    return [
        {
            "pressure_kpa": each.pressure_kpa,
            "phase": phase,
            "measured": score.rmse,
            "plain": each.plain[phase].rmse,
            "read": each.read[phase].rmse,
        }
        for each in read_trials(plant)
        for phase, score in each.measured.items()
    ]


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
    return TextTable(
        f"Table 30's RMSE: mean absolute error {plain:.2f} deg plain, {read:.2f} deg through the "
        "declared reading",
        header,
        rows,
    )
