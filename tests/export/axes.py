"""Slides and joints of the tests here, and what drives them."""

import numpy as np

from pma_gym.data.trial import Trial
from pma_gym.effects import CATALOGUE
from pma_gym.plant.model import Model

JOINT = {
    "torque_drive": {"gain": 1.0},
    "inertia": {"inertia_kg_m2": 0.005},
    "joint_start": {"angle_deg": 20.0, "spin_deg_per_s": 30.0},
    "joint_damping": {"coefficient_n_m_s": 0.01},
    "encoder": {"bandwidth_hz": 1000, "noise_deg": 0.02},
}
SLIDE = {
    "two_way_drive": {"gain_n_per_v": 100, "middle_v": 5},
    "slide": {"mass_kg": 2.0},
    "start": {"contraction_mm": 1.0, "velocity_mm_per_s": -5.0},
    "symmetric_damping": {"intercept_n_s_per_mm": 0.02, "slope_n_s_per_mm_per_kpa": 0.0},
    "lvdt": {"bandwidth_hz": 1000, "noise_mm": 0.02},
}


def axis(base, without=(), **tables):
    """A slide or joint with effects by their tables in files."""
    tables = {name: table for name, table in (base | tables).items() if name not in without}
    plant = "slide" if base is SLIDE else "joint"
    parameters = {name: CATALOGUE[name].parse(table) for name, table in tables.items()}
    return Model(f"own {plant}", f"A {plant}", plant, parameters)


def joint_friction(static=0.03, presliding=0.02):
    return {
        "static_n_m": static,
        "dynamic_n_m": 0.03,
        "stribeck_speed_deg_per_s": 5,
        "presliding_deg": presliding,
    }


def slide_friction(static=5, presliding=10):
    return {
        "static_n": static,
        "dynamic_n": 5,
        "stribeck_speed_mm_per_s": 5,
        "presliding_um": presliding,
    }


def driven(model, duration=1.5, interval=0.005):
    """A trial of two sines, which turn an axis often."""
    time = np.arange(0.0, duration, interval)
    shape = np.sin(4.0 * time) + 0.4 * np.sin(11.0 * time + 1.0)
    if model.plant == "slide":
        return Trial(time, {"motor_voltage": 5.0 + 0.1 * shape})
    if "dc_motor" in model.parameters:
        return Trial(time, {"winding_voltage": 4.0 * shape})
    return Trial(time, {"torque_command": 0.1 * shape})
