"""MuJoCo moves an exported axis as we do, but for what the export names."""

import numpy as np
import pytest

from pma_gym.export.c_plant import ExportError
from pma_gym.export.mjcf import IN_MUJOCO, THE_REST, lost_effects, mjcf, replay
from pma_gym.plant.model import load_model
from tests.export.axes import JOINT, SLIDE, axis, driven, joint_friction, slide_friction

pytest.importorskip("mujoco")

FINE_DEG, FINE_UM = 1e-5, 0.5
"""Presliding that the sensors here do not see."""

MOTOR = {"torque_constant_n_m_per_a": 0.1, "resistance_ohm": 4.0}
WEIGHT = {"moment_n_m": 0.3, "offset_deg": 25.0}
LAG, DELAY = {"share": 1, "time_constant_ms": 20}, {"share": 1, "delay_ms": 15}
SPRING = {"stiffness_n_m_per_rad": 0.5, "rest_deg": 10.0}

CARRIED = {
    "inertia": axis(JOINT, inertia={"inertia_kg_m2": 0.012}),
    "mass": axis(SLIDE, slide={"mass_kg": 5.0}),
    "damping of a joint": axis(JOINT, joint_damping={"coefficient_n_m_s": 0.05}),
    "dry friction and weight": axis(
        JOINT, joint_friction=joint_friction(presliding=FINE_DEG), joint_weight=WEIGHT
    ),
    "dry friction of a slide": axis(SLIDE, coulomb_friction=slide_friction(presliding=FINE_UM)),
    "spring": axis(JOINT, joint_spring=SPRING),
    "hardening spring": axis(
        JOINT, joint_spring=SPRING, joint_hardening_spring={"cubic_n_m_per_rad3": 0.5}
    ),
    "weight": axis(JOINT, joint_weight=WEIGHT),
    "gain of a joint": axis(JOINT, torque_drive={"gain": 1.3}),
    "gain of a slide": axis(SLIDE, two_way_drive={"gain_n_per_v": 130, "middle_v": 5}),
    "motor": axis(JOINT, without=("torque_drive",), dc_motor=MOTOR),
    "drag of a joint": axis(JOINT, joint_drag={"coefficient_n_m_s2": 0.005}),
    "drag of a slide": axis(SLIDE, quadratic_drag={"coefficient_n_s2_per_mm2": 1e-4}),
    "constant torque": axis(JOINT, constant_torque={"torque_n_m": 0.03}),
    "constant force": axis(SLIDE, constant_force={"force_n": 3.0}),
    "lag of the drive": axis(JOINT, drive_lag=LAG),
    "delay of the drive": axis(SLIDE, drive_delay=DELAY),
}
NAMED = {
    "joint_friction": axis(JOINT, joint_friction=joint_friction(0.05), joint_weight=WEIGHT),
    "coulomb_friction": axis(SLIDE, coulomb_friction=slide_friction(8.0)),
    "joint_directional_damping": axis(JOINT, joint_directional_damping={"difference_n_m_s": 0.01}),
    "directional_gain": axis(SLIDE, directional_gain={"difference_percent": 20.0}),
    "joint_load_friction": axis(
        JOINT,
        joint_load_friction={
            "drive_share_percent": 20.0,
            "carried_share_percent": 0.0,
            "presliding_deg": 0.02,
        },
    ),
}


@pytest.mark.parametrize("name", CARRIED)
def test_mujoco_moves_within_one_noise(name):
    model = CARRIED[name]
    sizes = replay([(model, driven(model))])
    assert np.all(sizes[IN_MUJOCO] <= 1.0), sizes


@pytest.mark.parametrize("name", NAMED)
def test_what_mujoco_cannot_carry_is_named_with_its_size(name):
    model = NAMED[name]
    assert name in mjcf(model)
    sizes = replay([(model, driven(model))])
    assert np.all(sizes[THE_REST] <= 1.0), sizes
    # Triangle: all of the difference is the effect's, but one noise.
    assert sizes[name].max() > 1.0
    assert np.all(
        np.abs(sizes[IN_MUJOCO] - sizes[name])
        <= 1.0 + sizes["encoder" if name.startswith("joint") else "lvdt"]
    )


def test_what_is_absent_is_not_named_and_a_sensor_is_with_all_of_its_own():
    model = axis(
        JOINT,
        joint_friction=joint_friction(),
        drive_lag=LAG | {"share": 0.0},
        encoder_delay=DELAY,
    )
    lost = {each.effect: each.without for each in lost_effects(model)}
    assert list(lost) == ["joint_friction", "encoder", "encoder_delay"]
    assert "encoder_delay" not in lost["encoder"].parameters
    assert "encoder" in lost["encoder_delay"].parameters


def test_a_station_is_no_joint():
    with pytest.raises(
        ExportError, match="takes a slide or a joint, model station is of a station"
    ):
        mjcf(load_model("station"))
