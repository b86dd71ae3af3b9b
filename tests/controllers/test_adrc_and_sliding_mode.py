"""ADRC: what it leaves of disturbances, its linear law, and trials on the station.

Sliding mode: the surface, the layer, the most that switching asks for, and trials.

LagDeadTimeModel and dead time against exact responses; the observer against the plant that it
assumes.
"""

import math
from dataclasses import replace

import control
import numpy as np
import pytest
from scipy.linalg import expm

from controllers import ADRC, SlidingMode, sliding_mode
from controllers.adrc import Settings
from controllers.models.local_model import LocalModel
from controllers.models.nominal_motion import nominal_motion
from controllers.observers.extended_state_observer import (
    ExtendedStateObserver,
    LagDeadTimeModel,
    lag_dead_time_model,
    place_of,
    placed,
)
from controllers.registry import LinearController
from pma_gym.tasks import ISOTONIC

PERIOD = 0.01


def begun(controller, station, pressure_kpa=300.0, delay=0.0):
    """A controller that is to stay where an isotonic trial begins: some volts from any limit."""
    given = replace(
        station(pressure_kpa=pressure_kpa), task=ISOTONIC["isotonic"], action_delay=delay
    )
    controller.reset(lambda time: 0.0, given)
    return given


def close(controller, reading, disturbance, steps):
    """Errors (m) of the plant that the controller assumes; d and its slope begin so (V, V/s)."""
    observer = controller._observer
    place, n = observer.places[observer.nearest(0.0)], observer.order
    rest = controller._motion.voltage(0.0)
    z, sent, errors = np.array([*[0.0] * n, *disturbance]), [0.0] * 10, []
    for k in range(steps):
        errors.append(z[0])
        voltage = controller.act(reading(extension=-z[0], load=200.0), k * PERIOD)
        sent.append(voltage - rest)
        z = place.step @ z
        z += place.older * sent[-place.since - 1] + place.newer * sent[-place.since]
    return np.array(errors)


@pytest.mark.parametrize("delay", [0.0, 0.02])
@pytest.mark.parametrize("disturbance", [(0.5, 0.0), (0.0, 0.5)])
def test_no_offset_is_left_of_a_constant_or_a_ramp(disturbance, delay, station, reading):
    controller = ADRC(Settings(0.6, 0.6))
    begun(controller, station, delay=delay)
    errors = close(controller, reading, disturbance, 500)
    assert np.abs(errors).max() > 5e-5
    # Of a ramp there is left what a voltage that is held over a period cannot follow.
    assert abs(errors[-1]) < 5e-3 * np.abs(errors).max()


@pytest.mark.parametrize("delay", [0.0, 0.02])
def test_linear_law_is_what_it_does(delay, station, reading):
    controller = ADRC(Settings(0.6, 0.6))
    given = begun(controller, station, delay=delay)
    law = controller.linear(given, 0.0)
    errors = np.random.default_rng(1).normal(0.0, 2e-5, 60)
    rest = controller._motion.voltage(0.0)
    got = [
        controller.act(reading(extension=error, load=200.0), k * PERIOD) - rest
        for k, error in enumerate(errors)
    ]
    known = control.forced_response(law, inputs=errors).outputs
    # The strokes of the two references end some nanometres apart.
    assert got == pytest.approx(known, rel=1e-4, abs=1e-6)
    assert isinstance(controller, LinearController)


def begun_sliding(controller, station, task=None, delay=0.0):
    given = replace(station(pressure_kpa=300.0), action_delay=delay)
    if task is not None:
        given = replace(given, task=task)
    controller.reset(given.task.schedule.at if task is None else lambda time: 0.0, given)
    return given


@pytest.mark.parametrize("task", [None, ISOTONIC["isotonic"]])
def test_surface_is_reached_as_fast_as_the_layer_says_and_the_error_dies_on_it(task, station):
    """Within the layer: s(k+1) = exp(-omega_s T) s(k); on s = 0 the error dies out as fast."""
    controller = SlidingMode(sliding_mode.Settings(0.5, 0.5, 1.0))
    begun_sliding(controller, station, task)
    observer = controller._observer
    place, surface = observer.places[5], controller._surfaces[5]
    n = observer.order
    pole = observer.pole(place.lags, 0.5)
    feedback = surface.equivalent + surface.switching
    closed = place.step[:n, :n] - np.outer(place.response, feedback[:n])
    s = surface.switching[:n]
    x = np.array([1e-3, -0.02])[:n]
    assert s @ closed @ x == pytest.approx(pole * (s @ x), rel=1e-9)
    if n == 2:
        # On the surface x' = -omega_s x.
        on = np.array([1.0, math.log(pole) / PERIOD])
        assert s @ on == pytest.approx(0.0, abs=1e-9 * abs(s[0]))
    # A step on the surface: what is left of x is the pole's share, to second order in the period.
    assert np.abs(np.linalg.eigvals(closed)).max() == pytest.approx(pole, abs=0.05)


def test_switching_asks_for_no_more_than_k(station, reading):
    """However large the error, beside equivalent control and disturbance."""
    most = 0.1
    controller = SlidingMode(sliding_mode.Settings(0.5, 0.5, most))
    begun_sliding(controller, station, ISOTONIC["isotonic"])
    generator, beyond = np.random.default_rng(0), 0
    for k in range(200):
        measured = reading(extension=float(generator.normal(0.0, 1e-3)), load=200.0)
        voltage = controller.act(measured, k * PERIOD)
        observer = controller._observer
        # What `update` returned, anew: it does not depend on what is sent afterwards.
        place = observer.places[observer.at]
        flying = place.flying @ observer._sent[-place.since - 1 : -1]
        ahead = place.ahead @ observer._estimate + flying
        surface = controller._surfaces[observer.at]
        pushed = controller._motion.command(k * PERIOD) - voltage
        pushed -= float(surface.equivalent @ ahead)
        if 0.0 < voltage < 10.0:
            assert abs(pushed) <= most + 1e-9
            beyond += abs(float(surface.switching @ ahead)) > most
    assert beyond > 20


def test_within_the_layer_it_is_linear_and_with_one_lag_adrc(station, reading):
    """Switching without end: the layer is everywhere."""
    sliding = SlidingMode(sliding_mode.Settings(0.5, 0.4, 1e6))
    adrc = ADRC(Settings(0.5, 0.4))
    given = begun_sliding(sliding, station)
    begun_sliding(adrc, station)
    noise = np.random.default_rng(2).normal(0.0, 2e-5, 100)
    # From the middle of the trial on, where no limit is near.
    times = 2.0 + PERIOD * np.arange(100)
    readings = [
        reading(extension=5e-3 * time + n, load=200.0) for time, n in zip(times, noise, strict=True)
    ]
    got = [sliding.act(r, t) for r, t in zip(readings, times, strict=True)]
    known = [adrc.act(r, t) for r, t in zip(readings, times, strict=True)]
    assert got == pytest.approx(known, abs=1e-9)
    law, other = sliding.linear(given, 12e-3), adrc.linear(given, 12e-3)
    assert control.poles(law) == pytest.approx(control.poles(other), abs=1e-6)


def test_a_narrow_layer_chatters(drive):
    """Beyond what the reference asks for the voltage moves many times as much."""
    _, calm = drive(SlidingMode(sliding_mode.Settings(0.6, 0.4, 0.1)), "displacement", 300)
    _, rough = drive(SlidingMode(sliding_mode.Settings(6.0, 0.4, 0.1)), "displacement", 300)
    calm_way, rough_way = (np.abs(np.diff(v)).sum() - (v[-1] - v[0]) for v in (calm, rough))
    assert rough_way > 5.0 * calm_way


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
