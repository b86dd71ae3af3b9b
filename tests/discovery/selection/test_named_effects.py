"""Effects that a first look overlooks or takes for another are named with their sizes."""

import numpy as np
import pytest

from pma_gym import Plant
from pma_gym.data.trial import Trial
from pma_gym.discovery import diagnose
from pma_gym.effects import CATALOGUE
from pma_gym.plant.model import Model
from tests.discovery.laboratory import OFF, STATION, commanded
from tests.discovery.test_imposed_motion import sizes_of

START = {"joint_start": {"angle_deg": 0.0, "spin_deg_per_s": 0.0}}
MOTOR = {
    "dc_motor": {"torque_constant_n_m_per_a": 0.4, "resistance_ohm": 4.0},
    "joint_weight": {"moment_n_m": 0.4, "offset_deg": 0.0},
    "inertia": {"inertia_kg_m2": 0.006},
    "encoder": {"bandwidth_hz": 2000.0, "noise_deg": 0.006},
}
WHEEL = {
    "torque_drive": {"gain": 1.0},
    "joint_damping": {"coefficient_n_m_s": 2.0},
    "inertia": {"inertia_kg_m2": 1.4},
    "encoder": {"bandwidth_hz": 2000.0, "noise_deg": 0.02},
}
TORSION = WHEEL | {
    "joint_damping": {"coefficient_n_m_s": 7.0},
    "joint_spring": {"stiffness_n_m_per_rad": 3700.0, "rest_deg": 0.0},
    "inertia": {"inertia_kg_m2": 2.1},
}
SHARES = {"drive_share_percent": 30.0, "carried_share_percent": 30.0, "presliding_deg": 0.02}
DRY = {"static_n_m": 7.0, "dynamic_n_m": 5.0, "stribeck_speed_deg_per_s": 3.0}


def joint(tables):
    """A joint of such tables that begins at rest."""
    parsed = {name: CATALOGUE[name].parse(table) for name, table in (tables | START).items()}
    return Model("arm", "An arm", "joint", parsed)


@pytest.mark.parametrize(
    ("known", "hidden", "command", "size", "seconds", "frequencies", "sizes"),
    [
        # Far from the trials a score tells little.
        pytest.param(
            MOTOR,
            {"joint_load_friction": SHARES},
            "winding_voltage",
            5.0,
            1.0,
            (0.7, 1.1, 1.6),
            {"joint_load_friction.drive_share_percent": 30.0},
            marks=pytest.mark.campaign,
        ),
        # A spring stands for the hardening one until the damping is there.
        (
            WHEEL,
            {
                "joint_hardening_spring": {"cubic_n_m_per_rad3": 8.0},
                "joint_directional_damping": {"difference_n_m_s": 1.0},
            },
            "torque_command",
            25.0,
            4.0,
            (0.7, 1.1),
            {
                "joint_hardening_spring.cubic_n_m_per_rad3": 8.0,
                "joint_directional_damping.difference_n_m_s": 1.0,
            },
        ),
        # The contact deflects a thousandth of what is usual before it slips.
        pytest.param(
            TORSION,
            {"joint_friction": DRY | {"presliding_deg": 2e-5}},
            "torque_command",
            60.0,
            3.0,
            (0.6, 2.0, 3.6),
            {"joint_friction.dynamic_n_m": 5.0},
            marks=pytest.mark.campaign,
        ),
    ],
)
def test_what_a_joint_hides_is_named(known, hidden, command, size, seconds, frequencies, sizes):
    plant, time, trials = Plant(joint(known | hidden)), np.arange(0.0, seconds, 0.005), []
    for seed, hertz in enumerate(frequencies):
        asked = size * np.sin(2.0 * np.pi * hertz * np.maximum(time - 0.4, 0.0))
        read = plant.simulate(Trial(time, {command: asked}), seed=seed)
        trials.append(Trial(time, read.commands, {"angle": read.measurements["angle"]}))
    diagnosis = diagnose(trials, joint(known), propose=False)
    named = sizes_of(diagnosis)
    assert {effect.name for effect in diagnosis.effects} == set(hidden), diagnosis.sentence
    for path, truth in sizes.items():
        assert named[path] == pytest.approx(truth, rel=0.05)


@pytest.mark.parametrize("effects", [{}, {"drive_dead_zone": {"width_n": 5.0, "slope": 2.0}}])
def test_a_beat_of_a_cable_that_comes_taut_names_what_makes_it(effects):
    plant, trials = Plant(STATION.with_effects(effects).replace(OFF)), []
    for number, asked in enumerate(commanded(3, 128.0)):
        commands = {name: np.array(row) for name, row in asked.commands.items()}
        if number == 0:
            commands["motor_voltage"] = np.interp(asked.time, [0.5, 2.0, 4.5], [0.0, 2.0, 0.5])
            commands["regulator_voltage"] += 1.0 * (asked.time < 0.5)
        trials.append(plant.simulate(Trial(asked.time, commands), seed=7 + number))
    diagnosis = diagnose(trials, STATION, propose=False)
    assert [effect.name for effect in diagnosis.effects] == list(effects), diagnosis.sentence
