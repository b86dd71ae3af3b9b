"""Noise of sensors: where a rig rests, from repeats, and as a lab states it."""

from dataclasses import replace

import numpy as np
import pytest

from pma_gym.data.datasets.dataset import NamedTrial
from pma_gym.data.datasets.lab_sensors import LabSensor
from pma_gym.data.signals import SIGNALS
from pma_gym.data.trial import Trial
from pma_gym.discovery.preparation.initial_floors import Level, initial_floors
from pma_gym.discovery.preparation.noise import (
    FIRST_REST_S,
    REST_S,
    Whitening,
    level_at_rest,
    rest_readings,
    rest_segments,
    step_between,
)
from pma_gym.discovery.preparation.quantisation import coarse_sensors, is_coarse
from pma_gym.estimation.logged import Logged
from pma_gym.plant.model import Model
from tests.discovery.laboratory import LEVELS, STATION, measured

CHANNELS = range(4)


def logged(motor, time=None, contraction=None):
    time = np.arange(len(motor)) / 64 if time is None else time
    contraction = np.zeros(len(time)) if contraction is None else contraction
    commands = {"motor_voltage": motor, "regulator_voltage": np.full(len(time), 5.0)}
    return Logged.of(STATION, 0, Trial(time, commands, {"contraction": contraction}))


def test_whitening_is_linear_and_missing_readings_leave_no_trace():
    noise, missing = Whitening((0.9, -0.2), 0.5, 0.8), np.array([0, 17, 18, 199])
    one, other = np.random.default_rng(1).standard_normal((2, 200))
    first, second, sums = (noise.white(x[None], missing) for x in (one, other, 2 * one - other))
    np.testing.assert_allclose(sums, 2 * first - second, atol=1e-12)
    one[missing] = 1e6
    assert np.array_equal(first, noise.white(one[None], missing))


def test_rest_is_where_commands_have_long_been_constant():
    motor, time = np.ones(10 * 64), np.arange(640) / 64
    motor[128:256] = 2.0 + np.arange(128) / 128
    first, last = rest_segments(logged(motor))
    assert time[first.start] == pytest.approx(FIRST_REST_S, abs=2 / 64)
    assert (first.stop, last.stop) == (128, len(motor))
    # Index 256 is where the last value begins.
    assert time[last.start] == pytest.approx(4.0 + REST_S, abs=2 / 64)
    # What always moves never rests.
    assert rest_segments(logged(1.0 + np.arange(640) / 640)) == []
    assert level_at_rest([]) is None


def test_noise_at_rest_is_the_sensors_and_the_daq_shows_its_step():
    readings = measured(STATION, 4, rate=128.0)
    trials = [Logged.of(STATION, i, trial) for i, trial in enumerate(readings)]
    for channel, signal in enumerate(STATION.rig.signals):
        level = level_at_rest(rest_readings(trials, channel))
        assert level == pytest.approx(LEVELS[channel], rel=0.2)
        assert step_between(trials, channel) == pytest.approx(signal.resolution, rel=1e-3)


def test_noise_of_a_few_readings_comes_from_repeats():
    """No segment rests long enough; the model's sensor says far less than repeats scatter."""
    rng, named = np.random.default_rng(4), []
    time, read = np.array([0.0, 5.0, 10.0, 15.0]), np.array([30e-3, np.nan, 20e-3, 29e-3])
    commands = {"motor_voltage": np.zeros(4), "regulator_voltage": np.full(4, 5.0)}
    for load in range(60):
        for repeat in range(3):
            trial = Trial(time, commands, {"contraction": read + rng.normal(0.0, 0.6e-3, 4)})
            first = f"{load} 0" if repeat else None
            named.append(NamedTrial(f"{load} {repeat}", trial, float(repeat), first))
    level, *_ = initial_floors(
        STATION, [Logged.of(STATION, i, each.trial) for i, each in enumerate(named)], named
    )
    assert level.source == "repeats" and level.level == pytest.approx(0.6e-3, rel=0.1)


@pytest.mark.parametrize(("level", "coarse"), [(0.3e3, True), (2.3e3, False)])
def test_a_step_that_noise_hides_makes_no_sensor_coarse(level, coarse):
    """Whole kPa in a file are nothing to a signal that scatters by more."""
    known = Level(SIGNALS["pressure"], level, "repeats", {}, 1e3, 0.479e3, 40)
    fine = Level(SIGNALS["load"], 1.0, "rest segments", {}, 0.0, 1.0, 40)
    sensors = coarse_sensors([fine, fine, fine, known])
    assert [each.name for each in sensors] == (["sensor_quantisation"] if coarse else [])


@pytest.mark.parametrize(
    ("step", "amplitude", "digits", "noise"),
    [(50e-9, 5e-3, 10, 0.3), (0.3e-3, 20e-3, 6, 0.4), (8e-5, 40e-3, 7, 1.0)],
)
def test_a_labs_own_encoder_tells_its_step_and_its_noise(step, amplitude, digits, noise):
    """50 nm or 0.3 mm: no number of the station's LVDT comes in, and no sensor is called coarse."""
    rng = np.random.default_rng(5)
    time = np.arange(6000) / 1000.0
    truth = amplitude * np.sin(2.0 * np.pi * 0.5 * time) + noise * step * rng.normal(size=6000)
    read = np.round(step * np.round(truth / step), digits)
    kept = {name: value for name, value in STATION.parameters.items() if name != "lvdt"}
    bare = Model("bare", "bare", "station", kept)
    trial = Trial(
        time,
        {"motor_voltage": np.sin(time) + 2.0, "regulator_voltage": np.full(6000, 5.0)},
        {"contraction": read},
    )
    rig = [Logged.of(bare, 0, trial)]
    assert rig[0].count == 6000
    floor = initial_floors(bare, rig, [NamedTrial("run", trial)])[0]
    assert floor.step == pytest.approx(step, rel=1e-3)
    assert floor.expected_step == 0.0
    assert floor.source == "neighbouring readings"
    assert floor.level == pytest.approx(step * np.hypot(noise, 1 / np.sqrt(12)), rel=0.25)
    assert coarse_sensors([floor]) == ()


def test_what_a_lab_states_of_its_sensor_counts_before_all_else():
    named = [NamedTrial(f"{i}", each) for i, each in enumerate(measured(STATION, 2))]
    trials = [Logged.of(STATION, i, each.trial) for i, each in enumerate(named)]
    stated = {"contraction": LabSensor(resolution=1e-5, noise=2e-4)}
    floor = initial_floors(STATION, trials, named, stated)[0]
    # The DAQ's step is five times what the lab states.
    assert (floor.level, floor.source, floor.expected_step) == (2e-4, "the lab's sensor", 1e-5)
    assert [is_coarse(replace(floor, level=level)) for level in (2e-4, 2e-5)] == [False, True]


def test_a_segment_in_which_the_rig_swings_on_is_no_rest():
    """Its drive is constant, its motion is not; a sensor's rest is as quiet everywhere."""
    time = np.arange(0.0, 8.0, 0.01)
    motor = np.repeat([2.0, 3.0, 2.0, 4.0], 200)
    rng = np.random.default_rng(7)
    noise = 1e-5 * rng.standard_normal(time.size)
    swing = 2e-3 * np.exp(-0.3 * time) * np.sin(9.0 * time)
    still = logged(motor, time, 0.01 + noise)
    swinging = logged(motor, time, 0.01 + noise + np.where(time < 4.0, swing, 0.0))
    channel = next(c for c in CHANNELS if still.measures[c])
    assert len(rest_readings([still], channel)) == 4
    quiet = level_at_rest(rest_readings([swinging], channel))
    assert quiet == pytest.approx(1e-5, rel=0.15)
