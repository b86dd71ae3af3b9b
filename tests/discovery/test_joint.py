"""A joint is diagnosed as a slide is: its weight, its friction, or nothing, in its own units.

A channel that is late beside the others is named, with its delay; a lone one has rivals.
"""

import math
from functools import cache

import numpy as np
import pytest

from pma_gym import Plant
from pma_gym.data.trial import Trial
from pma_gym.discovery import diagnose
from pma_gym.effects import CATALOGUE
from pma_gym.plant.model import Model

INERTIA, DAMPING, NOISE_DEG = 0.0049, 0.02, 0.02
TABLES = {
    "joint_weight": {"moment_n_m": 0.2, "offset_deg": 0.0},
    "joint_friction": {
        "static_n_m": 0.03,
        "dynamic_n_m": 0.03,
        "stribeck_speed_deg_per_s": 5.0,
        "presliding_deg": 0.02,
    },
}


def joint(inertia=INERTIA, **tables):
    """A joint with a torque drive, an encoder and viscous damping."""
    given = {
        "torque_drive": {"gain": 1.0},
        "joint_damping": {"coefficient_n_m_s": DAMPING},
        **tables,
        "inertia": {"inertia_kg_m2": inertia},
        "joint_start": {"angle_deg": 0.0, "spin_deg_per_s": 0.0},
        "encoder": {"bandwidth_hz": 2000.0, "noise_deg": NOISE_DEG},
    }
    return Model("arm", "An arm", "joint", {n: CATALOGUE[n].parse(t) for n, t in given.items()})


def logs(hidden="", count=3, seconds=4.0, rate=200.0):
    """Trials along sums of sines, under torques that about lead there, each measured twice."""
    generator, tables = np.random.default_rng(3), {hidden: TABLES[hidden]} if hidden else {}
    trials = []
    for _ in range(count):
        time = np.arange(0.0, seconds, 1.0 / rate)
        waves = [(generator.uniform(0.2, 0.6), f, generator.uniform(0, 6)) for f in (0.3, 0.7, 1.3)]
        angle = sum(size * np.sin(2 * np.pi * f * time + phase) for size, f, phase in waves)
        speed = np.gradient(angle, time)
        torque = INERTIA * np.gradient(speed, time) + DAMPING * speed
        torque += 0.2 * np.sin(angle) * (hidden == "joint_weight")
        torque += 0.03 * np.sign(speed) * (hidden == "joint_friction")
        start = {"joint_start.angle_deg": np.degrees(angle[0])}
        start["joint_start.spin_deg_per_s"] = np.degrees(speed[0])
        plant = Plant(joint(**tables).replace({path: float(v) for path, v in start.items()}))
        asked = Trial(time, {"torque_command": torque})
        exact = plant.simulate(asked, noise=False).measurements["angle"]
        for _ in range(2):
            noise = np.radians(NOISE_DEG) * generator.standard_normal(time.size)
            trials.append(Trial(time, asked.commands, {"angle": exact + noise}))
    return trials


def test_a_negative_first_command_is_a_torque_like_any_other():
    time = np.linspace(0.0, 0.1, 11)
    held = Plant(joint()).simulate(Trial(time, {"torque_command": np.full(11, -1.0)}), noise=False)
    assert held.measurements["angle"][-1] < 0.0


@pytest.mark.campaign
@pytest.mark.parametrize("hidden", ["joint_weight", "joint_friction"])
def test_what_a_joint_hides_is_named_with_its_size(hidden):
    diagnosis = diagnose(logs(hidden), joint(1.05 * INERTIA), propose=False)
    assert [effect.name for effect in diagnosis.effects] == [hidden]
    parameter = {"joint_weight": "moment_n_m", "joint_friction": "dynamic_n_m"}[hidden]
    size = diagnosis.effects[0].parameters[parameter].value
    assert size == pytest.approx(TABLES[hidden][parameter], rel=0.03)
    assert all("deg" in place.region or " s " in place.region for place in diagnosis.where)


def test_a_joint_that_hides_nothing_has_no_effect_named():
    diagnosis = diagnose(logs(), joint(1.05 * INERTIA), propose=False)
    assert diagnosis.verdict in ("parameters", "agrees", "undecidable") and not diagnosis.effects
    moved = diagnosis.parameters["inertia.inertia_kg_m2"]
    assert moved.now.value == pytest.approx(INERTIA, rel=2e-3)


DELAY_S, BEFORE_S = 7e-3, 0.2
NOISE = {"angle": math.radians(0.02), "speed": 0.02}
LATE_TABLES = {
    "torque_drive": {"gain": 1.0},
    "joint_damping": {"coefficient_n_m_s": 0.05},
    "inertia": {"inertia_kg_m2": 0.01},
    "joint_start": {"angle_deg": 10.0, "spin_deg_per_s": 0.0},
    "encoder": {"bandwidth_hz": 1000.0, "noise_deg": 0.02},
    "gyroscope": {"bandwidth_hz": 1000.0, "noise_rad_per_s": 0.02},
}
ARM = Model("arm", "An arm", "joint", {n: CATALOGUE[n].parse(t) for n, t in LATE_TABLES.items()})


@cache
def late_logs(*channels):
    """Trials of a heavier arm, cut from a longer log, whose angle another logger holds later."""
    generator, trials = np.random.default_rng(3), []
    heavier = Plant(ARM.replace({"inertia.inertia_kg_m2": 0.0105}))
    time = np.arange(0.0, 1.0, 0.01)
    fine = np.arange(0.0, time[-1] + BEFORE_S, 5e-4)
    for _ in range(2):
        waves = [(generator.uniform(0.1, 0.3), f, generator.uniform(0, 6)) for f in (0.4, 1.1, 2.3)]
        rows = np.arange(0.0, fine[-1] + 0.01, 0.01)
        asked = np.sum([a * np.sin(2 * np.pi * f * rows + p) for a, f, p in waves], axis=0)
        # Between its rows the command is a line, in the truth and in the model.
        torque = np.interp(fine, rows, asked)
        exact = heavier.simulate(Trial(fine, {"torque_command": torque}), noise=False).measurements
        command = np.interp(time + BEFORE_S, fine, torque)
        for _ in range(2):
            read = {}
            for name in channels:
                when = time + BEFORE_S - DELAY_S * (name == "angle")
                noise = NOISE[name] * generator.standard_normal(time.size)
                read[name] = np.interp(when, fine, exact[name]) + noise
            trials.append(Trial(time, {"torque_command": command}, read))
    return trials


def test_one_late_column_is_that_sensors_delay_with_its_size():
    diagnosis = diagnose(late_logs("angle", "speed"), ARM, propose=False)
    assert diagnosis.verdict == "effect", diagnosis.sentence
    (effect,) = diagnosis.effects
    assert effect.name == "encoder_delay", diagnosis.sentence
    delay = effect.parameters["delay_ms"]
    assert delay.low and delay.high and delay.low < 1e3 * DELAY_S < delay.high
    assert delay.high - delay.low < 0.1
    assert abs(diagnosis.model.parameters["inertia"].inertia / 0.0105 - 1.0) < 5e-3


def test_with_one_column_the_delays_of_sensor_and_command_are_rivals():
    diagnosis = diagnose(late_logs("angle"), ARM, propose=False)
    (effect,) = diagnosis.effects
    late = {"encoder_delay", "encoder_lag", "drive_delay", "drive_lag"}
    assert {effect.name, *effect.confused_with} == late, diagnosis.sentence
    assert all(name.replace("_", " ") in diagnosis.sentence for name in late)
