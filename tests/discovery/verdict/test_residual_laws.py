"""Laws without a shape of their own: drawn where they are, in words.

A sensor's drift is another in each trial; a leak begins with each trial alike.

What a lab calls good enough is not called unknown; without its word it is.
"""

from dataclasses import replace

import numpy as np
import pytest

from pma_gym import Plant
from pma_gym.data.datasets.dataset import Dataset, NamedTrial
from pma_gym.data.trial import Trial
from pma_gym.discovery.preparation.acceptance_floors import REPEATS, TOLERANCE, AcceptanceFloor
from pma_gym.discovery.preparation.noise import white_noise
from pma_gym.discovery.preparation.nuisance_projection import drift_columns
from pma_gym.discovery.thresholds import ALIKE_BESIDE, ALIKE_CHANCE
from pma_gym.discovery.verdict.adequacy import Adequacy, SignalAdequacy
from pma_gym.discovery.verdict.common_drift import (
    chance_of_common_drift,
    with_common_drift,
)
from pma_gym.discovery.verdict.residual_laws import words
from pma_gym.discovery.workflow import diagnose
from pma_gym.estimation.logged import Logged
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


LEVEL, TRIALS = 0.4e3, 6
PRESSURE = 3


@pytest.fixture(scope="module")
def logged():
    trials = measured(STATION, TRIALS)
    return [Logged.of(STATION, number, trial) for number, trial in enumerate(trials)]


def left(logged, rng, common=0.0, drift=0.6, lines=()):
    """White noise of a pressure, a drift of its own in each trial, and a fall that all share."""
    rows = []
    for each in logged:
        columns = np.array(drift_columns(each))
        time = each.time - each.time[0]
        own = drift * rng.standard_normal(len(columns)) @ columns
        fall = common * (1.0 - np.exp(-time / (0.5 * time[-1])))
        hum = sum((np.sin(2.0 * np.pi * hertz * time) for hertz in lines), np.zeros(time.size))
        row = np.zeros((len(each.signals), time.size))
        row[PRESSURE] = LEVEL * (rng.standard_normal(time.size) + own - fall + 2.0 * hum)
        rows.append(row)
    return rows


def noise(drift=0.6, lines=()):
    return replace(white_noise(LEVEL), drift=drift * LEVEL, lines=lines)


def test_a_fall_that_all_trials_share_is_no_drift_of_a_sensor(logged):
    rng = np.random.default_rng(6)
    chances = [
        chance_of_common_drift(logged, left(logged, rng, common=2.0), noise(), PRESSURE)
        for _ in range(50)
    ]
    assert np.mean(np.array(chances) < 0.001) > 0.9


@pytest.mark.parametrize(("source", "fault"), [(REPEATS, "alike"), (TOLERANCE, None)])
def test_an_adequate_signal_is_left_open_unless_the_lab_is_content(logged, source, fault):
    rows = left(logged, np.random.default_rng(9), common=3.0)
    name = logged[0].signals[PRESSURE].name
    judged = Adequacy({name: SignalAdequacy(AcceptanceFloor(LEVEL, source), 1.0, 0.1, 0.2, 1.0)})
    noises = [white_noise(1.0)] * PRESSURE + [noise()]
    after = with_common_drift(judged, logged, rows, noises)
    assert after.signals[name].fault == fault
    assert (after.undecided is None) == (fault is None) and after.structure is None
    # Beside effects it takes more to withhold a name; then it comes before whatever else is wrong.
    faint = left(logged, np.random.default_rng(9), common=0.8)
    chance = chance_of_common_drift(logged, faint, noise(), PRESSURE)
    assert ALIKE_BESIDE < chance < ALIKE_CHANCE
    assert with_common_drift(judged, logged, faint, noises).signals[name].fault == fault
    assert with_common_drift(judged, logged, faint, noises, beside=True) == judged
    # What is wrong already stays so.
    wrong = Adequacy({name: replace(judged.signals[name], fault="misfit")})
    assert with_common_drift(wrong, logged, rows, noises) == wrong
    after = with_common_drift(wrong, logged, rows, noises, beside=True)
    assert after.signals[name].fault == (fault or "misfit")
    chance = chance_of_common_drift(logged, rows, noise(), PRESSURE)
    assert after.alike == (
        fault and (name, replace(wrong.signals[name], fault=fault, common=chance))
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
