"""Sliding mode: the surface, the layer, the most that switching asks for, and trials."""

import math
from dataclasses import replace

import control
import numpy as np
import pytest

from controllers import ADRC, SlidingMode
from controllers import adrc as adrc_file
from controllers.sliding_mode import Settings
from pma_gym.tasks import ISOTONIC

PERIOD = 0.01


def begun(controller, station, task=None, delay=0.0):
    given = replace(station(pressure_kpa=300.0), action_delay=delay)
    if task is not None:
        given = replace(given, task=task)
    controller.reset(given.task.schedule.at if task is None else lambda time: 0.0, given)
    return given


@pytest.mark.parametrize("task", [None, ISOTONIC["isotonic"]])
def test_surface_is_reached_as_fast_as_the_layer_says_and_the_error_dies_on_it(task, station):
    """Within the layer: s(k+1) = exp(-omega_s T) s(k); on s = 0 the error dies out as fast."""
    controller = SlidingMode(Settings(0.5, 0.5, 1.0))
    begun(controller, station, task)
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
    controller = SlidingMode(Settings(0.5, 0.5, most))
    begun(controller, station, ISOTONIC["isotonic"])
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
    sliding = SlidingMode(Settings(0.5, 0.4, 1e6))
    adrc = ADRC(adrc_file.Settings(0.5, 0.4))
    given = begun(sliding, station)
    begun(adrc, station)
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
    _, calm = drive(SlidingMode(Settings(0.6, 0.4, 0.1)), "displacement", 300)
    _, rough = drive(SlidingMode(Settings(6.0, 0.4, 0.1)), "displacement", 300)
    calm_way, rough_way = (np.abs(np.diff(v)).sum() - (v[-1] - v[0]) for v in (calm, rough))
    assert rough_way > 5.0 * calm_way
