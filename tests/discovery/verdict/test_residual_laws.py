"""Laws without a shape of their own: drawn where they are, in words.

What a lab calls good enough is not called unknown; without its word it is.
"""

import numpy as np
import pytest

from pma_gym import Plant
from pma_gym.data.datasets.dataset import Dataset, NamedTrial
from pma_gym.data.trial import Trial
from pma_gym.discovery.verdict.residual_laws import words
from pma_gym.discovery.workflow import diagnose
from tests.discovery.laboratory import BUMP, OFF, STATION, measured
from tests.plant.test_imposed import imposed

AT = np.linspace(0.0, 40.0, 9)
ERRORS = np.full(9, 0.1)
BENT = np.linspace(-1.5, 2.5, 9) * np.abs(np.linspace(-1.5, 2.5, 9)) ** 0.3
CONTRACTION = "contraction (mm)"


@pytest.mark.campaign
def test_an_effect_outside_the_catalogue_is_unknown():
    truth = STATION.with_effects(BUMP).replace(OFF)
    trials = measured(truth, 6, rate=32.0, kinds=(0,), kpa=(240.0, 300.0))
    diagnosis = diagnose(trials, STATION, propose=False)
    assert diagnosis.verdict == "unknown"
    assert not diagnosis.effects
    assert diagnosis.law is not None
    assert diagnosis.law.variable == CONTRACTION
    assert diagnosis.law.at[int(np.argmax(diagnosis.law.law))] == pytest.approx(24.0, abs=3.0)
    assert "no effect of the catalogue" in diagnosis.sentence


@pytest.mark.parametrize(
    ("law", "said"),
    [
        (
            8.0 * np.exp(-(((AT - 20.0) / 4.0) ** 2)),
            "a bump, confined in contraction; most near",
        ),
        (5.0 * np.cos(np.pi * np.arange(9)), "it changes sign 8 times"),
        (
            BENT,
            "it goes one way over all of contraction",
        ),
        (3.0 * (1.0 - (AT / 20.0 - 1.0) ** 2) + 1.0, "it bends over contraction"),
        (np.zeros(9), "no height of it leaves 0"),
        (0.15 * np.ones(9), "no height of it leaves 0"),
    ],
)
def test_shapes_in_words(law, said):
    assert words(AT, law, ERRORS, CONTRACTION).startswith(said)


def test_words_name_size_place_and_side():
    law = -8.0 * np.exp(-(((AT - 20.0) / 4.0) ** 2))
    assert words(AT, law, ERRORS, CONTRACTION).endswith(
        "most near 20 mm: 8 N less than the model has"
    )


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
        (1.4 * NOISE, {"agrees", "parameters"}),
        (0.7 * NOISE, {"unknown", "effect"}),
    ],
)
def test_a_drift_within_the_tolerance_is_not_unknown(size, verdicts):
    given = RIG.replace({"symmetric_damping.intercept_n_s_per_mm": 0.19})
    diagnosis = diagnose(drifting({"force": size}), given, propose=False)
    assert diagnosis.verdict in verdicts, diagnosis.sentence
    if "agrees" in verdicts:
        assert "within" in diagnosis.sentence
