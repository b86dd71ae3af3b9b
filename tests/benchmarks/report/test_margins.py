"""Margins of loops: against analytic ones, and against what the closed loop then does."""

import math
from dataclasses import replace

import control
import numpy as np
import pytest

from benchmarks.report.margins import (
    check_law,
    closed_poles,
    is_linear,
    load_step,
    loops,
    margins,
    reference_step,
    worst,
)
from benchmarks.tuning.loop_margins import linearised, sampled
from controllers.design.designs import Gains
from controllers.pid import PID, FeedforwardPID, linear_law
from controllers.serres_feedforward import ImprovedFeedforward
from pma_gym.envs import Measurement, StationInfo
from pma_gym.plant.model import load_model
from pma_gym.tasks import TASKS

PERIOD = 0.01
GAINS = Gains(60.0, 900.0, 0.5, 0.005)


def station(task="displacement", pressure=300e3, **more):
    return StationInfo(load_model("station"), TASKS[task], pressure, PERIOD, **more)


def sampled_integrator(gain):
    """gain / s sampled: gain T / (z - 1)."""
    return control.ss([[1.0]], [[gain * PERIOD]], [[1.0]], [[0.0]], PERIOD)


def unit(gain=1.0):
    return control.ss([], [], [], [[gain]], PERIOD)


def test_integrator_has_the_margins_of_the_textbook():
    # |L| = 1 where 2 sin(w T / 2) = g T; the phase there is -90 deg - w T / 2. At half the control
    # rate the response is -g T / 2.
    gain = 20.0
    margin = margins(sampled_integrator(gain), unit())
    crossing = 2.0 / PERIOD * math.asin(gain * PERIOD / 2.0)
    phase = math.pi / 2.0 - crossing * PERIOD / 2.0
    assert margin.stable
    assert margin.gain == pytest.approx(2.0 / (gain * PERIOD), rel=1e-6)
    assert margin.phase == pytest.approx(phase, rel=1e-4)
    assert margin.crossover == pytest.approx(crossing, rel=1e-4)
    assert margin.delay == pytest.approx(phase / crossing, rel=1e-4)
    assert margin.sensitivity == pytest.approx(1.0 / (1.0 - gain * PERIOD / 2.0), rel=1e-6)


def test_gain_margin_is_where_the_closed_loop_becomes_unstable():
    plant, law = _displacement_loop()
    edge = margins(plant, law).gain
    assert 1.5 < edge < 20.0
    for factor, stable in ((0.99 * edge, True), (1.01 * edge, False)):
        assert margins(plant * unit(factor), law).stable is stable
        assert (np.abs(closed_poles(plant * unit(factor) * law)).max() < 1.0) is np.bool_(stable)


def test_delay_margin_is_the_delay_that_the_loop_bears():
    plant, law = _displacement_loop()
    margin = margins(plant, law)
    whole = math.floor(margin.delay / PERIOD)

    def late(steps):
        chain = control.ss(
            np.eye(steps, k=-1), np.eye(steps)[:, :1], np.eye(steps)[-1:], 0.0, PERIOD
        )
        return margins(plant * chain, law)

    assert whole >= 1
    assert late(whole).stable
    assert not late(whole + 1).stable
    # A period of delay takes a period from the margin.
    assert late(whole).delay == pytest.approx(margin.delay - whole * PERIOD, rel=1e-3)


def test_station_delays_are_part_of_the_plant():
    prompt, late = station(), station(action_delay=0.01, observation_delay=0.01)
    place = linearised(prompt, [0.5])[0]
    plants = [sampled(place, each) for each in (prompt, late)]
    z = np.exp(1j * np.linspace(0.1, 3.0, 7))
    ratio = plants[1](z) / plants[0](z)
    assert ratio == pytest.approx(z**-2, rel=1e-9)


def test_law_is_what_the_pid_does():
    # The same errors into the linear law and into the controller, which starts at 0 V offset.
    where = station(pressure=300e3)
    pid = FeedforwardPID(GAINS, _Nothing())
    errors = 1e-4 * (1.5 + np.sin(0.7 * np.arange(40)))
    pid.reset(lambda time: 0.0, where)
    said = [
        pid.act(Measurement(PERIOD * k, -error, 0.0, 0.0, 300e3), PERIOD * k)
        for k, error in enumerate(errors)
    ]
    system = control.StateSpace(*linear_law(GAINS, PERIOD), PERIOD)
    wanted = control.forced_response(system, PERIOD * np.arange(40), errors).outputs
    # The first derivative is 0, for there is no error before it: a kick that the law has.
    kick = GAINS.derivative / (GAINS.filter + PERIOD) * errors[0]
    kicks = kick * (GAINS.filter / (GAINS.filter + PERIOD)) ** np.arange(40)
    assert np.array(said) + kicks == pytest.approx(np.squeeze(wanted), rel=1e-9)


class _Nothing:
    def reset(self, reference, station):
        """Nothing to compute."""

    def voltage(self, time):
        return 0.0


def test_closed_loop_follows_and_rejects():
    (loop,) = loops([PID()], station(), [0.5])
    assert loop.margins.stable
    _, position = reference_step(loop, 3.0)
    assert position[0] == 0.0
    assert position[-1] == pytest.approx(1.0, abs=1e-4)
    # The integral takes away what a held disturbance does.
    _, disturbed = load_step(loop, 3.0)
    assert disturbed.max() > 1e-5
    assert disturbed[-1] == pytest.approx(0.0, abs=1e-3 * disturbed.max())


def test_margins_over_the_stroke_are_the_least():
    loops_there = loops([PID(), FeedforwardPID(), ImprovedFeedforward()], station("rotation"))
    assert {loop.name for loop in loops_there} == {"pid", "feedforward_pid"}
    mine = [loop for loop in loops_there if loop.name == "pid"]
    least = worst(mine)
    assert [loop.share for loop in mine] == [0.05, 0.5, 0.95]
    assert least.gain == min(loop.margins.gain for loop in mine)
    assert least.sensitivity == max(loop.margins.sensitivity for loop in mine)


def test_both_directions_are_looked_at_where_their_damping_differs():
    where = replace(station("rotation"), model=load_model("serres2008"))
    directions = [loop.direction for loop in loops([PID()], where, [0.5])]
    assert directions == ["relaxing", "contracting"]


def test_feedforward_has_no_loop():
    assert is_linear(PID())
    assert not is_linear(ImprovedFeedforward())


def test_law_of_another_period_is_refused():
    law = control.ss([], [], [], [[1.0]], 0.02)
    with pytest.raises(ValueError, match=r"mine.linear must give one voltage.*every 0.01 s"):
        check_law("mine", law, PERIOD)


def _displacement_loop():
    where = station()
    place = linearised(where, [0.5])[0]
    return sampled(place, where), PID().linear(where, 12.5e-3)
