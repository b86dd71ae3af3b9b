"""What friction in the motor's bearing and play at the potentiometer leave in data."""

import numpy as np
import pytest

from pma_gym.data.trial import Trial
from pma_gym.effects import CATALOGUE
from pma_gym.effects.sensors.potentiometer_backlash import play, play_rate
from pma_gym.plant.model import ModelError, load_model

TIME = np.arange(0.0, 20.0, 0.01)
MOTOR = np.interp(TIME, [0.0, 1.0, 10.0, 19.0, 20.0], [1.0, 1.0, 4.0, 1.0, 1.0])


def slowly(plant, motor=MOTOR):
    """Measurements and truth while the motor winds in and lets go slowly, at 300 kPa."""
    commands = {
        "motor_voltage": motor,
        "regulator_voltage": np.full(len(TIME), plant.regulator_voltage(300e3)),
    }
    trial = Trial(time=TIME, commands=commands, measurements={})
    logged = plant.simulate(trial, noise=False)
    return logged.measurements, logged.truth


@pytest.mark.parametrize("force", [5.0, 12.0])
def test_friction_in_the_bearing_is_told_by_the_direction_at_one_voltage(station_with, force):
    plant = station_with("bearing_friction", force_n=force)
    _, truth = slowly(plant)
    drive = plant.model.parameters["drive"]
    missing = drive.gain * MOTOR + drive.offset - truth["load"]
    inwards, outwards = (TIME > 4.0) & (TIME < 9.9), (TIME > 13.0) & (TIME < 18.9)
    np.testing.assert_allclose(missing[inwards], force, atol=0.05)
    np.testing.assert_allclose(missing[outwards], -force, atol=0.05)


def test_without_it_the_load_is_that_of_the_voltage(station):
    _, truth = slowly(station)
    drive = station.model.parameters["drive"]
    missing = drive.gain * MOTOR + drive.offset - truth["load"]
    away_from_the_turn = (TIME > 4.0) & (TIME < 18.9) & (abs(TIME - 10.0) > 0.5)
    assert np.abs(missing[away_from_the_turn]).max() < 0.05


@pytest.mark.parametrize("width", [2.0, 5.0])
def test_play_is_lost_at_every_turn(station_with, width):
    plant = station_with("potentiometer_backlash", width_deg=width)
    measured, truth = slowly(plant)
    missing = np.degrees(truth["rotation"] - measured["rotation"])
    assert missing[0] == pytest.approx(0.0, abs=1e-6)
    inwards, outwards = (TIME > 4.0) & (TIME < 9.9), (TIME > 13.0) & (TIME < 18.9)
    np.testing.assert_allclose(missing[inwards], 0.5 * width, atol=0.05)
    np.testing.assert_allclose(missing[outwards], -0.5 * width, atol=0.05)
    # Just after the turn the reading stands still while the pulley goes back.
    turned = (TIME > 10.0) & (truth["rotation"] > truth["rotation"].max() - np.radians(0.9 * width))
    went = np.ptp(np.degrees(truth["rotation"][turned]))
    assert np.ptp(np.degrees(measured["rotation"][turned])) < 0.15 * went


def test_play_is_nowhere_but_in_the_potentiometer(station_with, station):
    readings, expected = slowly(station_with("potentiometer_backlash")), slowly(station)
    for name, values in expected[1].items():
        np.testing.assert_allclose(readings[1][name], values, atol=1e-5 * np.ptp(values) + 1e-12)


def test_the_reading_never_runs_backwards():
    p = CATALOGUE["potentiometer_backlash"].usual
    for z in np.linspace(-1.0, 1.0, 41):
        for spin in (-1.0, 1.0):
            source, decay = play_rate(spin, z, p)
            reading = spin + play(source - decay * z, p)
            assert -1e-12 <= reading * spin <= 1.0 + 1e-12


def test_a_cascade_has_no_play():
    with pytest.raises(ModelError, match="take plant = 'station'"):
        load_model("cascade").with_effects({"potentiometer_backlash": {"width_deg": 2.0}})
