"""A joint swings, decays, spins up and sticks as the textbook's does."""

import numpy as np
import pytest
from scipy.special import ellipk

from pma_gym import Plant
from pma_gym.data.files.trial_files import read_trial
from pma_gym.data.trial import Trial, TrialError
from pma_gym.effects import CATALOGUE
from pma_gym.envs import PMAEnv
from pma_gym.plant.model import Model

INERTIA = 0.0049
NEUTRAL = {
    name: CATALOGUE[name].neutral
    for name in ("joint_weight", "joint_spring", "joint_damping", "joint_friction")
}


def joint(torque_drive=False, start=0.0, **tables):
    """A joint with effects given by their tables in files."""
    drive = {"torque_drive": {"gain": 1.0}}
    if not torque_drive:
        drive = {"dc_motor": {"torque_constant_n_m_per_a": 0.387, "resistance_ohm": 4.0}}
    given = {
        **drive,
        **tables,
        "inertia": {"inertia_kg_m2": INERTIA},
        "joint_start": {"angle_deg": start, "spin_deg_per_s": 0.0},
    }
    parameters = {name: CATALOGUE[name].parse(table) for name, table in given.items()}
    return Model("joint", "A joint", "joint", parameters)


def swung(model, duration, command=0.0, name="torque_command"):
    """Times (s), angle (rad) and speed (rad/s) under a constant command."""
    time = np.linspace(0.0, duration, 2001)
    trial = Trial(time, {name: np.full(time.size, command)})
    measured = Plant(model).simulate(trial, noise=False).measurements
    return time, measured["angle"], measured["speed"]


def test_a_joint_settles_at_its_start_without_a_pressure_and_is_called_a_joint():
    model = joint(True, 20.0, joint_weight={"moment_n_m": 0.48, "offset_deg": 0.0})
    rest = Plant(model).settle()
    assert dict(zip(Plant(model).states, rest.state, strict=True))["angle"] == np.radians(20.0)
    with pytest.raises(ValueError, match="model joint is of a joint without a regulator.*300 kPa"):
        Plant(model).settle(pressure=300e3)
    with pytest.raises(ValueError, match='plant = "joint": make it with gym.make'):
        PMAEnv("rotation", model=model)


@pytest.mark.parametrize(("start", "turns"), [(1.0, 0), (60.0, 0), (60.0, 1000), (150.0, 0)])
def test_a_pendulums_period_is_that_of_the_elliptic_integral(start, turns):
    weight = {"moment_n_m": 0.48, "offset_deg": 0.0}
    time, angle, _ = swung(joint(True, start + 360.0 * turns, joint_weight=weight), 3.0)
    angle = angle - 2.0 * np.pi * turns
    falls = np.flatnonzero((angle[:-1] > 0.0) & (angle[1:] <= 0.0))
    crossed = [time[i] + (time[1] * angle[i] / (angle[i] - angle[i + 1])) for i in falls]
    period = 4.0 * np.sqrt(INERTIA / 0.48) * ellipk(np.sin(np.radians(start) / 2.0) ** 2)
    assert np.diff(crossed) == pytest.approx(period, rel=1e-4)


def test_a_spring_with_damping_decays_as_it_must():
    tables = {
        "joint_spring": {"stiffness_n_m_per_rad": 0.5, "rest_deg": 0.0},
        "joint_damping": {"coefficient_n_m_s": 0.01},
    }
    time, angle, _ = swung(joint(True, 20.0, **tables), 2.0)
    decay = 0.01 / (2.0 * INERTIA)
    rate = np.sqrt(0.5 / INERTIA - decay**2)
    swing = np.cos(rate * time) + decay / rate * np.sin(rate * time)
    np.testing.assert_allclose(angle, np.radians(20.0) * np.exp(-decay * time) * swing, atol=2e-5)


def test_a_motor_runs_up_to_where_its_back_emf_is_its_voltage():
    time, _, speed = swung(joint(), 1.0, 5.0, "winding_voltage")
    lag = INERTIA * 4.0 / 0.387**2
    np.testing.assert_allclose(speed, 5.0 / 0.387 * (1.0 - np.exp(-time / lag)), atol=2e-3)


FRICTION = {
    "static_n_m": 0.02,
    "dynamic_n_m": 0.02,
    "stribeck_speed_deg_per_s": 5.0,
    "presliding_deg": 0.02,
}


def test_friction_holds_a_torque_that_grows_to_below_it():
    time = np.linspace(0.0, 2.0, 2001)
    trial = Trial(time, {"torque_command": 0.0085 * time})
    held = Plant(joint(True, joint_friction=FRICTION)).simulate(trial, noise=False)
    assert np.degrees(np.abs(held.truth["angle"])).max() < 0.05


def test_a_sliding_joint_loses_what_friction_takes():
    time, angle, _ = swung(joint(True, joint_friction=FRICTION), 1.0, 0.03)
    later = time > 0.2
    gained = 2.0 * np.polyfit(time[later], angle[later], 2)[0]
    assert gained == pytest.approx((0.03 - 0.02) / INERTIA, rel=1e-3)


def test_neutral_effects_are_absent_to_the_last_bit():
    bare = joint(True, 30.0)
    whole = Model("joint", "", "joint", {**bare.parameters, **NEUTRAL})
    for one, other in zip(swung(bare, 1.0, 0.1), swung(whole, 1.0, 0.1), strict=True):
        np.testing.assert_array_equal(one, other)


def test_the_wrong_command_is_refused_with_the_right_one():
    trial = Trial(np.arange(3) * 0.1, {"torque_command": np.zeros(3)})
    with pytest.raises(TrialError, match="give winding_voltage_v"):
        Plant(joint()).simulate(trial)


def test_files_hold_radians_too(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("time_s,torque_command_n_m,angle_rad\n0,0,0.5\n0.1,0,0.6\n", "utf-8")
    np.testing.assert_array_equal(read_trial(path).measurements["angle"], [0.5, 0.6])
