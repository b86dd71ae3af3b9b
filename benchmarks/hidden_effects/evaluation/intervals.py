"""Whether the 95 % intervals of a model's own parameters hold what is true of the rig."""

from collections.abc import Mapping
from typing import Any

from benchmarks.hidden_effects.evaluation.troubles import RIGHT_STRUCTURE
from pma_gym.discovery.grey_box.slots import quantity_of, slot

STATION: dict[str, str] = {
    "contractile_force.slope_n_per_kpa": "force_slope",
    "contractile_force.intercept_n": "force_intercept",
    "stiffness.low_intercept_n_per_mm": "stiffness_low",
    "stiffness.low_slope_n_per_mm_per_kpa": "stiffness_low_slope",
    "stiffness.high_intercept_n_per_mm": "stiffness_high",
    "stiffness.high_slope_n_per_mm_per_kpa": "stiffness_high_slope",
    "damping.contracting_n_s_per_mm": "damping_contracting",
    "damping.relaxing_n_s_per_mm": "damping_relaxing",
    "damping.high_intercept_n_s_per_mm": "damping_high",
    "damping.high_slope_n_s_per_mm_per_kpa": "damping_high_slope",
    "drive.gain_n_per_v": "drive_gain",
    "drive.offset_n": "drive_offset",
    "rotor.radius_mm": "radius",
    "rotor.inertia_kg_m2": "inertia",
    "slide.mass_kg": "mass",
    "cable.stiffness_n_per_mm": "cable_stiffness",
    "regulator_lag.time_constant_s": "regulator_time",
}
"""The generator's name of a number (SI) by the path of a station's model."""

RIG: dict[str, str] = {
    "slide.mass_kg": "inertia",
    "symmetric_damping.intercept_n_s_per_mm": "damping",
    "spring.stiffness_n_per_mm": "stiffness",
    "coulomb_friction.static_n": "friction",
    "inertia.inertia_kg_m2": "inertia",
    "joint_damping.coefficient_n_m_s": "damping",
    "joint_spring.stiffness_n_m_per_rad": "stiffness",
    "joint_weight.moment_n_m": "gravity",
    "joint_friction.static_n_m": "friction",
}
"""The same of the other rigs."""

COMPLETE = (*RIGHT_STRUCTURE, "effect")
"""Verdicts that say that the model is complete with what is named: then its numbers are claims."""


def held(truth: Mapping[str, Any], answer: Mapping[str, Any]) -> dict[str, bool]:
    """Whether each interval holds the truth, by path; of an incomplete model none is claimed.

    Left out is what the true rig has none of, and a damping beside damping by direction, which has
    two true ones.
    """
    if answer["verdict"] not in COMPLETE:
        return {}
    rig, friction = truth.get("rig", {}), truth.get("friction", {})
    names = RIG if rig else STATION
    true = {**rig, "friction": friction.get("true")} if rig else truth.get("base", {})
    two = any("directional_damping" in effect["name"] for effect in truth["effects"])
    out = {}
    for path, estimate in answer["parameters"].items():
        name = names.get(path, "")
        low, high = estimate.get("low"), estimate.get("high")
        if low is None or high is None or not true.get(name) or (name == "damping" and two):
            continue
        out[path] = low <= quantity_of(slot(path)).from_si(true[name]) <= high
    return out
