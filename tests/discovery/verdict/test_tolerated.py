"""What a lab calls good enough is not called unknown; without its word it is."""

import numpy as np
import pytest

from pma_gym import Plant
from pma_gym.data.datasets.dataset import Dataset, NamedTrial
from pma_gym.data.trial import Trial
from pma_gym.discovery import diagnose
from tests.plant.test_imposed import imposed

NOISE = 0.3
TIME = np.arange(0.0, 30.0, 0.02)
RIG = imposed(
    force_sensor={"bandwidth_hz": 1000.0, "noise_n": 0.0},
    symmetric_damping={"intercept_n_s_per_mm": 0.2, "slope_n_s_per_mm_per_kpa": 0.0},
)


def drifting(tolerance):
    """Logs of a load cell that drifts, another way in each, and of no repeats."""
    rng, named = np.random.default_rng(5), []
    for number, hertz in enumerate((0.23, 0.31, 0.17, 0.27)):
        stroke = 0.02 * np.sin(2.0 * np.pi * hertz * TIME) ** 3
        force = Plant(RIG).simulate(Trial(TIME, {"contraction_command": stroke}), noise=False)
        drift = np.sin(2.0 * np.pi * (0.7 + 0.2 * number) * TIME / TIME[-1] + number)
        read = force.measurements["force"] + NOISE * (
            rng.standard_normal(len(TIME)) + 0.8 * np.sqrt(2.0) * drift
        )
        trial = Trial(TIME, {"contraction_command": stroke}, {"force": read})
        named.append(NamedTrial(f"run_{number}.csv", trial))
    return Dataset("Logs", None, tuple(named), tolerance=tolerance)


@pytest.mark.parametrize(
    ("size", "verdicts"),
    [
        pytest.param(1.4 * NOISE, {"agrees", "parameters"}, marks=pytest.mark.campaign),
        (0.7 * NOISE, {"unknown", "effect"}),
    ],
)
def test_a_drift_within_the_tolerance_is_not_unknown(size, verdicts):
    given = RIG.replace({"symmetric_damping.intercept_n_s_per_mm": 0.19})
    diagnosis = diagnose(drifting({"force": size}), given, propose=False)
    assert diagnosis.verdict in verdicts, diagnosis.sentence
    if "agrees" in verdicts:
        assert "within" in diagnosis.sentence
