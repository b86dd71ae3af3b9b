"""What effects of the drive leave in data: dead zone, saturation, lag, ripple."""

import numpy as np
import pytest

from pma_gym.effects import CATALOGUE
from pma_gym.effects.arithmetic import cosine
from pma_gym.effects.drive.drive_dead_zone import load_beyond_dead_zone
from pma_gym.effects.drive.drive_lag import late_load, late_rate
from pma_gym.effects.drive.torque_ripple import ripple_load

VOLTAGES = np.array([0.0, 0.1, 0.2, 0.3, 0.5, 1.0, 2.0, 4.0])


def held_loads(plant, voltages=VOLTAGES, pressure=300e3):
    """Load cell (N) at rest under each voltage."""
    rests = [plant.settle(float(voltage), pressure) for voltage in voltages]
    seen = [plant.observe(rest.state[None, :], rest.zero_contraction) for rest in rests]
    return np.array([truth["load"][0] for truth in seen])


def asked(plant, voltages=VOLTAGES):
    drive = plant.model.parameters["drive"]
    return np.maximum(0.0, drive.gain * voltages + drive.offset)


def test_a_dead_zone_misses_the_start_and_catches_up(station_with):
    plant = station_with("drive_dead_zone", width_n=15.0)
    plain, loads = asked(plant), held_loads(plant)
    expected = np.where(plain < 15.0, 0.0, np.minimum(plain, 2.0 * (plain - 15.0)))
    np.testing.assert_allclose(loads, expected, rtol=1e-8, atol=1e-7)
    assert loads[1] == pytest.approx(0.0, abs=1e-9) and plain[1] > 5.0
    np.testing.assert_allclose(loads[-3:], plain[-3:], rtol=1e-9)


@pytest.mark.parametrize("slope", [1.2, 2.0, 4.0])
def test_a_dead_zone_neither_pushes_nor_falls_and_ends(slope):
    p = CATALOGUE["drive_dead_zone"].parse({"width_n": 15.0, "slope": slope})
    asked = np.linspace(0.0, 100.0, 401)
    loads = np.array([load_beyond_dead_zone(load, p) for load in asked])
    assert np.all(loads >= 0.0) and np.all(np.diff(loads) >= 0.0)
    ended = asked > 15.0 * slope / (slope - 1.0)
    np.testing.assert_array_equal(loads[ended], asked[ended])
    within = (asked > 0.0) & (asked < 15.0 * slope / (slope - 1.0) - 1e-9)
    assert np.all(loads[within] < asked[within])


@pytest.mark.parametrize("slope", [1.2, 2.0, 4.0])
def test_without_a_width_the_slope_does_nothing(slope):
    p = CATALOGUE["drive_dead_zone"].parse({"width_n": 0.0, "slope": slope})
    loads = [0.0, 1e-300, 1e-9, 0.1, 1.0 / 3.0, 976.0]
    assert [load_beyond_dead_zone(load, p) for load in loads] == loads


def test_a_file_from_before_the_slope_means_2():
    effect = CATALOGUE["drive_dead_zone"]
    old = effect.parse({"width_n": 15.0})
    assert old == effect.parse({"width_n": 15.0, "slope": 2.0}) and old.slope == 2.0
    loads = np.linspace(0.0, 100.0, 401)
    np.testing.assert_array_equal(
        [load_beyond_dead_zone(load, old) for load in loads],
        np.minimum(loads, 2.0 * np.maximum(loads - 15.0, 0.0)),
    )
    with pytest.raises(ValueError, match=r"takes width_n, slope; unknown: slop, missing: none"):
        effect.parse({"width_n": 15.0, "slop": 2.0})
    with pytest.raises(ValueError, match=r"unknown: none, missing: width_n"):
        effect.parse({"slope": 2.0})
    with pytest.raises(ValueError, match=r"drive_dead_zone.slope must lie in 1.2 to 4"):
        effect.parse({"width_n": 15.0, "slope": 1.0})


def test_a_saturated_drive_clips_its_tops(station_with):
    plant = station_with("drive_saturation", limit_n=150.0)
    np.testing.assert_allclose(
        held_loads(plant), np.minimum(asked(plant), 150.0), rtol=1e-8, atol=1e-7
    )


@pytest.mark.parametrize("share", [1.0, 0.4])
def test_a_late_drive_follows_a_step_exponentially(station_with, share):
    plant = station_with("drive_lag", share=share, time_constant_ms=20.0)
    rest, regulator = plant.settle(2.0, 300e3), plant.regulator_voltage(300e3)
    drive, p = plant.model.parameters["drive"], plant.model.parameters["drive_lag"]
    at = plant.states.index("memory_drive_lag")
    before, after = (drive.gain * v + drive.offset for v in (2.0, 3.0))
    assert rest.state[at] == pytest.approx(share * before, rel=1e-12)
    for i in range(1, 9):
        plant.step(rest, 3.0, regulator, 0.01)
        arrived = late_load(after, rest.state[at], p)
        expected = after - share * (after - before) * np.exp(-0.01 * i / 0.02)
        assert arrived == pytest.approx(expected, rel=1e-5)


def test_a_late_drive_is_statically_absent(station_with):
    plant = station_with("drive_lag")
    np.testing.assert_allclose(held_loads(plant), asked(plant), rtol=1e-8, atol=1e-7)
    source, decay = late_rate(300.0, plant.model.parameters["drive_lag"])
    assert source / decay == pytest.approx(300.0)


def test_a_late_drive_is_part_of_the_linear_system(station_with, station):
    late = station_with("drive_lag", time_constant_ms=20.0).linearize(300e3, 0.03)
    plain = station.linearize(300e3, 0.03)
    assert late.nstates == plain.nstates + 1
    assert np.min(np.abs(late.poles() + 50.0)) < 1e-3
    at = late.output_labels.index("extension"), late.input_labels.index("motor_voltage")
    gains = [np.real(system.dcgain())[at] for system in (late, plain)]
    assert gains[0] == pytest.approx(gains[1], rel=1e-4)


def test_the_laws_cosine_is_exact_to_1e_11():
    values = np.concatenate([np.linspace(-300.0, 300.0, 20_001), np.linspace(-1e4, 1e4, 20_001)])
    assert np.abs(cosine(values) - np.cos(values)).max() < 1e-11


def test_ripple_comes_as_often_a_turn_as_it_says(station_with):
    plant = station_with("torque_ripple", amplitude_percent=1.0, periods=24.0, phase_deg=0.0)
    voltages = np.linspace(1.0, 5.0, 150)
    rests = [plant.settle(float(voltage), 300e3) for voltage in voltages]
    truth = [plant.observe(rest.state[None, :], rest.zero_contraction) for rest in rests]
    loads = np.array([seen["load"][0] for seen in truth])
    angles = np.array([seen["rotation"][0] for seen in truth])
    share = loads / asked(plant, voltages) - 1.0
    assert np.abs(share).max() == pytest.approx(0.01, rel=1e-3)
    np.testing.assert_allclose(share, 0.01 * np.cos(24.0 * angles), atol=1e-8)
    assert np.ptp(angles) > np.radians(60.0)


def test_ripple_repeats_after_a_period_and_has_no_mean():
    p = CATALOGUE["torque_ripple"].parse(
        {"amplitude_percent": 0.5, "periods": 12.0, "phase_deg": 40.0}
    )
    turn = np.linspace(0.0, 2.0 * np.pi, 241)[:-1]
    loads = np.array([ripple_load(400.0, angle, p) for angle in turn])
    assert loads.mean() == pytest.approx(0.0, abs=1e-9)
    assert loads.max() <= 2.0 + 1e-12
    np.testing.assert_allclose(loads, np.roll(loads, 20), atol=1e-9)


def test_one_effect_of_the_drive_takes_what_the_one_before_gives():
    # In catalogue order: dead zone, limit, delay, lag, ripple, whatever order a file has.
    names = [name for name in CATALOGUE if name.startswith("drive_") or name == "torque_ripple"]
    shape = ["drive_dead_zone", "drive_saturation"]
    assert names == [*shape, "drive_delay", "drive_lag", "torque_ripple"]
