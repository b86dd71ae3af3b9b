"""A sensor's drift is another in each trial; a leak begins with each trial alike."""

from dataclasses import replace

import numpy as np
import pytest

from pma_gym.discovery.preparation.acceptance_floors import REPEATS, TOLERANCE, AcceptanceFloor
from pma_gym.discovery.preparation.noise import white_noise
from pma_gym.discovery.preparation.nuisance_projection import drift_columns
from pma_gym.discovery.verdict.adequacy import Adequacy, SignalAdequacy
from pma_gym.discovery.verdict.common_drift import (
    CHANCE,
    SURELY,
    chance_of_common_drift,
    with_common_drift,
)
from pma_gym.estimation.logged import Logged
from tests.discovery.laboratory import STATION, measured

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


def test_own_drifts_are_alike_as_often_as_chance_has_it(logged):
    rng = np.random.default_rng(5)
    chances = [
        chance_of_common_drift(logged, left(logged, rng), noise(), PRESSURE) for _ in range(200)
    ]
    assert 0.4 < np.mean(chances) < 0.6
    assert 0.04 < np.mean(np.array(chances) < 0.1) < 0.17
    assert np.mean(np.array(chances) < 0.001) < 0.02


def test_a_fall_that_all_trials_share_is_no_drift_of_a_sensor(logged):
    rng = np.random.default_rng(6)
    chances = [
        chance_of_common_drift(logged, left(logged, rng, common=2.0), noise(), PRESSURE)
        for _ in range(50)
    ]
    assert np.mean(np.array(chances) < 0.001) > 0.9


def test_lines_beside_it_change_nothing(logged):
    quiet = left(logged, np.random.default_rng(7))
    humming = left(logged, np.random.default_rng(7), lines=(50.0,))
    known = noise(lines=(50.0,))
    one, other = (
        chance_of_common_drift(logged, rows, known, PRESSURE) for rows in (quiet, humming)
    )
    assert one == pytest.approx(other, rel=1e-6)


def test_few_trials_and_sensors_without_a_drift_say_nothing(logged):
    rows = left(logged, np.random.default_rng(8), common=5.0)
    assert chance_of_common_drift(logged[:2], rows[:2], noise(), PRESSURE) == 1.0
    assert chance_of_common_drift(logged, rows, white_noise(LEVEL), PRESSURE) == 1.0


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
    assert SURELY < chance_of_common_drift(logged, faint, noise(), PRESSURE) < CHANCE
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
