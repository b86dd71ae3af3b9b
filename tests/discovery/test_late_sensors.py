"""A channel that is late beside the others is named, with its delay; a lone one has rivals."""

import math
from functools import cache

import numpy as np
import pytest

from pma_gym import Plant
from pma_gym.data.trial import Trial
from pma_gym.discovery import diagnose
from pma_gym.effects import CATALOGUE
from pma_gym.plant.model import Model

DELAY_S, BEFORE_S = 7e-3, 0.2
NOISE = {"angle": math.radians(0.02), "speed": 0.02}
TABLES = {
    "torque_drive": {"gain": 1.0},
    "joint_damping": {"coefficient_n_m_s": 0.05},
    "inertia": {"inertia_kg_m2": 0.01},
    "joint_start": {"angle_deg": 10.0, "spin_deg_per_s": 0.0},
    "encoder": {"bandwidth_hz": 1000.0, "noise_deg": 0.02},
    "gyroscope": {"bandwidth_hz": 1000.0, "noise_rad_per_s": 0.02},
}
ARM = Model("arm", "An arm", "joint", {n: CATALOGUE[n].parse(t) for n, t in TABLES.items()})


@cache
def logs(*channels):
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


@pytest.mark.campaign
def test_one_late_column_is_that_sensors_delay_with_its_size():
    diagnosis = diagnose(logs("angle", "speed"), ARM, propose=False)
    assert diagnosis.verdict == "effect", diagnosis.sentence
    (effect,) = diagnosis.effects
    assert effect.name == "encoder_delay", diagnosis.sentence
    delay = effect.parameters["delay_ms"]
    assert delay.low and delay.high and delay.low < 1e3 * DELAY_S < delay.high
    assert delay.high - delay.low < 0.1
    assert abs(diagnosis.model.parameters["inertia"].inertia / 0.0105 - 1.0) < 5e-3


def test_with_one_column_the_delays_of_sensor_and_command_are_rivals():
    diagnosis = diagnose(logs("angle"), ARM, propose=False)
    (effect,) = diagnosis.effects
    late = {"encoder_delay", "encoder_lag", "drive_delay", "drive_lag"}
    assert {effect.name, *effect.confused_with} == late, diagnosis.sentence
    assert all(name.replace("_", " ") in diagnosis.sentence for name in late)
