"""The printed validation under triangular pressure (figures 28 and 29), as a summary.

The dissertation prints how far its own model lay from what was measured, in millimetres and in
percent of the contraction that was measured. So its stroke, largest less smallest contraction, is
known to the rounding of the percentage; the curves themselves are pictures.
"""

from dataclasses import dataclass

import numpy as np

from pma_gym.data.trial import Trial
from pma_gym.plant.model import Model
from pma_gym.plant.plant import Plant
from pma_gym.units import SI_FACTORS

CYCLES, RATE_HZ = 3, 100.0


@dataclass(frozen=True)
class Triangle:
    """One validation trial.

    Attributes:
        figure: its number.
        low_kpa: lower pressure (kPa).
        high_kpa: upper pressure (kPa).
        load_n: load (N).
        period_s: period (s).
        rmse_mm: of the dissertation's model (mm).
        percent: the same, in percent of the contraction.
    """

    figure: int
    low_kpa: float
    high_kpa: float
    load_n: float
    period_s: float
    rmse_mm: float
    percent: float

    @property
    def stroke_mm(self) -> tuple[float, float]:
        """Least and largest stroke (mm) that the printed figures allow."""
        return (
            100.0 * self.rmse_mm / (self.percent + 0.5),
            100.0 * self.rmse_mm / (self.percent - 0.5),
        )

    def contraction(self, model: Model) -> np.ndarray:
        """Simulate the contraction in the last period (m), shape (n,)."""
        count = round(CYCLES * self.period_s * RATE_HZ)
        time = np.arange(count + 1) / RATE_HZ
        phase = np.mod(time / self.period_s, 1.0)
        share = 1.0 - np.abs(2.0 * phase - 1.0)
        pressure = self.low_kpa + (self.high_kpa - self.low_kpa) * share
        trial = Trial(
            time,
            {
                "pressure_command": pressure * SI_FACTORS["kPa"],
                "load_command": np.full(len(time), self.load_n),
            },
        )
        truth = Plant(model).simulate(trial, noise=False).truth["contraction"]
        return truth[time >= (CYCLES - 1) * self.period_s]


TRIANGLES = (
    Triangle(28, 150.0, 250.0, 150.0, 4.0, 1.94, 17.0),
    Triangle(29, 450.0, 550.0, 400.0, 10.0, 1.38, 25.0),
)
"""Serres 2008, section 5.1.5."""


@dataclass(frozen=True)
class ModelComparison:
    """A model held against one validation trial.

    Attributes:
        figure: its number.
        model: name of the model.
        stroke_mm: the model's stroke (mm).
        printed_mm: least and largest that the printed figures allow (mm).
        apart_mm: rms distance from the dissertation's model, their means taken out (mm).
        rmse_mm: what was printed of that model (mm).
    """

    figure: int
    model: str
    stroke_mm: float
    printed_mm: tuple[float, float]
    apart_mm: float
    rmse_mm: float


def compare_models(models: dict[str, Model], own: Model) -> list[ModelComparison]:
    """Models against both trials.

    Args:
        models: by name.
        own: the dissertation's model.
    """
    rows = []
    for triangle in TRIANGLES:
        theirs = triangle.contraction(own)
        for name, model in models.items():
            ours = triangle.contraction(model)
            apart = (ours - ours.mean()) - (theirs - theirs.mean())
            rows.append(
                ModelComparison(
                    triangle.figure,
                    name,
                    1e3 * float(np.ptp(ours)),
                    triangle.stroke_mm,
                    1e3 * float(np.sqrt(np.mean(apart**2))),
                    triangle.rmse_mm,
                )
            )
    return rows
