"""LagDeadTimeModel and dead time against exact responses; the observer against the plant that it
assumes."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from controllers.models.local_model import LocalModel
from controllers.models.nominal_motion import nominal_motion
from controllers.observers.extended_state_observer import (
    ExtendedStateObserver,
    LagDeadTimeModel,
    lag_dead_time_model,
    place_of,
    placed,
)
from pma_gym.tasks import ISOTONIC

PERIOD = 0.01


def sampled(gain, constants, period=PERIOD):
    """A chain of lags, its voltage held over each period."""
    n = len(constants)
    rates = np.zeros((n + 1, n + 1))
    for i, constant in enumerate(constants):
        rates[i, i] = -1.0 / constant
        rates[i, i + 1] = (gain if i == n - 1 else 1.0) / constant
    whole = expm(rates * period)
    slowest = max(constants)
    return LocalModel(whole[:n, :n], whole[:n, n], np.eye(n)[0], gain, slowest)


def test_one_lag_is_found_exactly():
    lags = lag_dead_time_model(sampled(8e-3, [0.05]), PERIOD, 1)
    assert lags.gain == 8e-3
    assert lags.constants == pytest.approx([0.05], rel=1e-9)
    # The mean of a held response is off by T^2 / 12 tau of the lag's own.
    assert lags.dead_time == pytest.approx(PERIOD**2 / 12.0 / 0.05, rel=0.05)


def test_small_lags_are_dead_time():
    small = [0.004, 0.002]
    lags = lag_dead_time_model(sampled(8e-3, [*small, 0.05]), PERIOD, 1)
    assert lags.constants == pytest.approx([0.05], rel=1e-6)
    assert lags.dead_time == pytest.approx(sum(small), abs=3e-4)


def test_two_lags_are_found():
    lags = lag_dead_time_model(sampled(8e-3, [0.045, 0.06]), PERIOD, 2)
    assert lags.constants == pytest.approx([0.06, 0.045], rel=1e-6)


@pytest.mark.parametrize("constants", [(0.05,), (0.06, 0.045)])
def test_poles_are_placed(constants):
    place = place_of(LagDeadTimeModel(8e-3, constants, 0.004), PERIOD, 0.02, pole=0.6)
    n = len(constants)
    kept = np.eye(n + 2) - np.outer(place.correction, np.eye(n + 2)[0])
    # Poles of one place are ill-conditioned: rounding moves four of them by its fourth root.
    assert np.linalg.eigvals(kept @ place.step) == pytest.approx(0.6, abs=2e-3)
    closed = place.step[:n, :n] - np.outer(place.response, place.feedback(0.7))
    assert np.linalg.eigvals(closed) == pytest.approx(0.7, abs=1e-5)


def test_placed_is_ackermann_s_formula():
    a, b = np.array([[1.0, 0.1], [0.0, 1.0]]), np.array([0.005, 0.1])
    assert np.poly(a - np.outer(b, placed(a, b, 0.5))) == pytest.approx(np.poly([0.5, 0.5]))


PARTS = 1000
"""Steps of the simulated plant in a period."""


def simulated(lags, late, voltages, disturbance):
    """z of a plant at every part of a period; voltages act so many parts late."""
    small, driven = expm(lags.rates * PERIOD / PARTS), len(lags.constants)
    by_voltage = small[:, driven] - np.eye(len(small))[driven]
    z, seen = np.zeros(len(small)), []
    z[driven:] = disturbance
    for i in range(len(voltages) * PARTS):
        seen.append(z)
        z = small @ z + by_voltage * (voltages[(i - late) // PARTS] if i >= late else 0.0)
    return np.array(seen)


@pytest.mark.parametrize("constants", [(0.05,), (0.06, 0.045)])
def test_observer_foresees_a_plant_of_its_own_kind(constants, station, reading):
    """Dead time 3.7 ms, commands 20 ms late, together 2.37 periods; d begins at 0.2 V."""
    lags, delay, slope = LagDeadTimeModel(8e-3, constants, 0.0037), 0.02, 0.3
    late = round((lags.dead_time + delay) / PERIOD * PARTS)
    voltages = np.random.default_rng(0).normal(0.0, 0.1, 60)
    # x is driven as soon as a voltage is sent and seen `late` parts later, or the other way round.
    truth = simulated(lags, 0, voltages, (0.2, slope))
    observer = ExtendedStateObserver(nominal_motion(lambda time: 0.0, station()), 1.0)
    observer.places = [place_of(lags, PERIOD, delay, pole=0.5)] * len(observer.places)
    observer._estimate = np.zeros(len(constants) + 2)
    observer._sent = np.zeros(observer.places[0].since + 1)
    # No cable that could be slack.
    observer._loose = -math.inf
    for k, voltage in enumerate(voltages):
        delayed = truth[k * PARTS - late][0] if k * PARTS >= late else 0.0
        predicted = observer.update(reading(extension=delayed), k * PERIOD)
        observer.send(voltage)
    assert predicted == pytest.approx(truth[(len(voltages) - 1) * PARTS], rel=1e-4, abs=1e-7)
    assert predicted[-2] == pytest.approx(0.2 + slope * (len(voltages) - 1) * PERIOD, rel=1e-5)


def test_regulator_has_two_lags(station):
    task = ISOTONIC["isotonic"]
    given = replace(station(pressure_kpa=250.0), task=task)
    observer = ExtendedStateObserver(nominal_motion(task.schedule.at, given), 0.5)
    assert observer.order == 2
    regulator, muscle = observer.places[0].lags.constants
    # The regulator's lag and its mean with venting; B / K of the muscle about 0.05 s.
    part = given.model.parameters
    lag, vented = part["regulator_lag"].time_constant, part["regulator_asymmetry"].vent_ratio
    assert regulator == pytest.approx(lag * 0.5 * (1.0 + vented), abs=0.003)
    assert muscle == pytest.approx(0.05, abs=0.006)
