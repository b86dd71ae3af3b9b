"""The literature's force laws: limits, work, and what each leaves of table I3."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from pma_gym.data.serres2008 import load_table
from pma_gym.effects.muscle.colbrunn import COLBRUNN_SPRING
from pma_gym.effects.muscle.geometric_force import (
    CALDWELL_FORCE,
    CHOU_HANNAFORD_FORCE,
    SCHULTE_FORCE,
    SCHULZ_FORCE,
    TONDU_LOPEZ_FORCE,
)
from pma_gym.effects.muscle.repperger import REPPERGER_DAMPING, REPPERGER_SPRING, repperger_damping
from pma_gym.effects.muscle.sarosi import SAROSI_FORCE

MUSCLE = {"scale": 1.0, "resting_length_mm": 250.0, "resting_diameter_mm": 20.0}
NUMBERS = {
    "schulte_force": MUSCLE | {"turns": 2.085},
    "schulz_force": MUSCLE
    | {"turns": 1.780, "elasticity_n_per_mm": 3.348, "shell_friction": 0.0, "tube_friction": 0.0},
    "chou_hannaford_force": MUSCLE
    | {"turns": 2.012, "thickness_mm": 1.0, "resting_diameter_mm": 22.0},
    "caldwell_force": MUSCLE | {"turns": 2.085, "cap_diameter_mm": 20.0},
    "tondu_lopez_force": MUSCLE | {"turns": 1.881, "end_factor": 1.442},
    "sarosi_force": {
        "toe_slope_n_per_bar": 6.15,
        "toe_force_n": 299.7,
        "steepness_per_percent": 0.2955,
        "softening_n_per_bar_per_percent": 8.878,
        "slope_n_per_bar": 277.1,
        "offset_n": -267.3,
        "resting_length_mm": 250.0,
    },
    "colbrunn_spring": {
        "stiffness_n_per_mm": 13.19,
        "stiffening_n_per_mm_per_kpa": 0.00072,
        "hardening_length_mm": 88.03,
        "reach_mm": 157.2,
        "half_pressure_kpa": 684.5,
    },
    "repperger_spring": {
        "stiffness_n_per_mm": 25.01,
        "stiffening_n_per_mm_per_kpa": 0.03403,
        "linear_n_per_mm2": -0.6378,
        "quadratic_n_per_mm3": 0.005308,
    },
    "repperger_damping": {
        "viscous_n_s_per_mm": 1.79,
        "stiffening_n_s_per_mm_per_kpa": 0.0016,
        "speed_slope_n_s2_per_mm2": 0.0020,
    },
}
"""Parameters of the MAS-20-250 as files have them: what the sources of each law state."""

GEOMETRIC = (
    SCHULTE_FORCE,
    SCHULZ_FORCE,
    CHOU_HANNAFORD_FORCE,
    CALDWELL_FORCE,
    TONDU_LOPEZ_FORCE,
)
SPRINGS = (*GEOMETRIC, SAROSI_FORCE, COLBRUNN_SPRING, REPPERGER_SPRING)


def law(effect, **changed):
    """Force of an effect as a function of pressure (kPa) and contraction (mm)."""
    p = effect.parse(NUMBERS[effect.name] | changed)
    return lambda pressure, contraction: effect.law(pressure * 1e3, contraction * 1e-3, p)


def muscle(effect):
    """Force of the muscle; Repperger's spring stands beside a contractile force."""
    alone = law(effect)
    if effect is not REPPERGER_SPRING:
        return alone
    return lambda pressure, contraction: alone(pressure, contraction) + 2.739 * pressure + 44.9


def thread(turns, diameter=20.0):
    return math.hypot(250.0, math.pi * turns * diameter)


@pytest.mark.parametrize("contraction", [-5.0, 0.0, 20.0, 60.0])
def test_eq1_is_the_textbook_form_in_the_braid_angle(contraction):
    cosine = (250.0 - contraction) / thread(2.085)
    widest = 20.0 / math.sin(math.atan(math.pi * 2.085 * 20.0 / 250.0)) * 1e-3
    expected = math.pi * widest**2 * 400e3 / 4.0 * (3.0 * cosine**2 - 1.0)
    assert law(SCHULTE_FORCE)(400.0, contraction) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("angle", [20.0, 25.0, 30.0])
def test_eq1_and_eq5_at_rest_in_the_angle(angle):
    turns = math.tan(math.radians(angle)) * 250.0 / (math.pi * 20.0)
    a, b = 3.0 / math.tan(math.radians(angle)) ** 2, 1.0 / math.sin(math.radians(angle)) ** 2
    expected = math.pi * 0.01**2 * 300e3 * (a - b)
    assert law(SCHULTE_FORCE, turns=turns)(300.0, 0.0) == pytest.approx(expected, rel=1e-12)
    for k in (1.0, 1.3):
        force = law(TONDU_LOPEZ_FORCE, turns=turns, end_factor=k)
        assert force(300.0, 0.0) == pytest.approx(expected, rel=1e-12)
        shortest = 250.0 / k * (1.0 - math.sqrt(b / a))
        assert force(300.0, shortest) == pytest.approx(0.0, abs=1e-9)


def test_eq1_vanishes_at_the_magic_angle_at_every_pressure():
    force = law(SCHULTE_FORCE)
    for pressure in (100.0, 300.0, 600.0):
        shortest = brentq(lambda x, at=pressure: force(at, x), 0.0, 140.0, xtol=1e-12)
        cosine = (250.0 - shortest) / thread(2.085)
        assert math.degrees(math.acos(cosine)) == pytest.approx(54.7356, abs=1e-4)


@pytest.mark.parametrize("contraction", [-5.0, 0.0, 30.0, 60.0])
@pytest.mark.parametrize(
    ("effect", "changed"),
    [
        (SCHULZ_FORCE, {"elasticity_n_per_mm": 0.0}),
        (CHOU_HANNAFORD_FORCE, {"thickness_mm": 0.0, "resting_diameter_mm": 20.0}),
        (CALDWELL_FORCE, {"cap_diameter_mm": 0.0}),
        (TONDU_LOPEZ_FORCE, {"end_factor": 1.0}),
    ],
    ids=lambda value: getattr(value, "name", ""),
)
def test_each_refinement_absent_leaves_eq1(effect, changed, contraction):
    ideal = law(SCHULTE_FORCE)(350.0, contraction)
    assert law(effect, turns=2.085, **changed)(350.0, contraction) == pytest.approx(
        ideal, rel=1e-11
    )


def test_caps_count_only_where_the_tube_is_narrower():
    ideal, capped = law(SCHULTE_FORCE), law(CALDWELL_FORCE, cap_diameter_mm=24.0)
    # d = sqrt(b^2 - L^2) / (pi n) is 24 mm at this contraction.
    touches = 250.0 - math.sqrt(thread(2.085) ** 2 - (math.pi * 2.085 * 24.0) ** 2)
    assert 0.0 < touches < 20.0
    assert capped(300.0, touches + 1.0) == pytest.approx(ideal(300.0, touches + 1.0), rel=1e-12)
    assert capped(300.0, touches) == pytest.approx(ideal(300.0, touches), rel=1e-12)
    end = (math.pi * 0.024**2 / 4.0 - math.pi * 0.020**2 / 4.0) * 300e3
    assert capped(300.0, 0.0) == pytest.approx(ideal(300.0, 0.0) - end, rel=1e-12)


def volume(contraction, turns, diameter, wall=0.0):
    """Volume (m^3) inside a braid with a wall of constant thickness (mm)."""
    length = 250.0 - contraction
    across = math.sqrt(thread(turns, diameter) ** 2 - length**2) / (math.pi * turns)
    return math.pi / 4.0 * (across - 2.0 * wall) ** 2 * length * 1e-9


def hoop_energy(contraction):
    """Energy (J) of the tube of `schulz_force`: elasticity/2 (d/D0 - 1)^2 pi D0 L0."""
    across = math.sqrt(thread(1.780) ** 2 - (250.0 - contraction) ** 2) / (math.pi * 1.780)
    return 0.5 * 3348.0 * (across / 20.0 - 1.0) ** 2 * math.pi * 0.020 * 0.250


@pytest.mark.parametrize("contraction", [-2.0, 5.0, 30.0, 60.0])
@pytest.mark.parametrize(
    ("effect", "braid", "energy"),
    [
        (SCHULTE_FORCE, (2.085, 20.0, 0.0), lambda x: 0.0),
        (CHOU_HANNAFORD_FORCE, (2.012, 22.0, 1.0), lambda x: 0.0),
        (SCHULZ_FORCE, (1.780, 20.0, 0.0), hoop_energy),
    ],
    ids=["schulte", "chou_hannaford", "schulz"],
)
def test_work_of_the_force_is_work_of_the_pressure_less_what_the_tube_keeps(
    effect, braid, energy, contraction
):
    h = 1e-3
    swept = volume(contraction + h, *braid) - volume(contraction - h, *braid)
    kept = energy(contraction + h) - energy(contraction - h)
    work = (400e3 * swept - kept) / (2e-3 * h)
    assert law(effect)(400.0, contraction) == pytest.approx(work, rel=1e-6)


def test_friction_of_eq2_acts_on_the_pressure_that_the_tube_leaves():
    smooth, rough = law(SCHULZ_FORCE), law(SCHULZ_FORCE, shell_friction=0.01)
    # At the resting diameter the tube is slack: contact is the whole pressure on pi D0 L0.
    loss = 0.01 * 300e3 * math.pi * 0.020 * 0.250
    assert smooth(300.0, 0.0) - rough(300.0, 0.0) == pytest.approx(loss, rel=1e-9)
    # Too little pressure to reach the braid: nothing rubs.
    assert rough(1.0, 60.0) == smooth(1.0, 60.0)


def test_sarosi_in_the_units_of_the_source():
    p, k = 4.0, 12.0
    expected = (6.15 * p + 299.7) * math.exp(-0.2955 * k) - 8.878 * p * k + 277.1 * p - 267.3
    assert law(SAROSI_FORCE)(100.0 * p, 2.5 * k) == pytest.approx(expected, rel=1e-10)


def test_colbrunn_carries_nothing_at_its_free_length_and_hardens_beyond():
    force = law(COLBRUNN_SPRING)
    free = 157.2 * 300.0 / (300.0 + 684.5)
    assert force(300.0, free) == pytest.approx(0.0, abs=1e-9)
    stiffness = 13.19 + 0.00072 * 300.0
    assert force(300.0, free - 88.03) == pytest.approx(2.0 * stiffness * 88.03, rel=1e-12)
    assert force(300.0, free + 10.0) == pytest.approx(-force(300.0, free - 10.0), rel=1e-12)


def test_repperger_is_a_polynomial_in_position_and_a_line_in_velocity():
    stiffness = 25.01 + 0.03403 * 300.0 - 0.6378 * 20.0 + 0.005308 * 20.0**2
    assert law(REPPERGER_SPRING)(300.0, 20.0) == pytest.approx(-20.0 * stiffness, rel=1e-12)
    p = REPPERGER_DAMPING.parse(NUMBERS["repperger_damping"])
    rest_force = 1.79e3 + 1.6 * 300.0
    for velocity in (0.1, 0.0, -0.1):
        assert repperger_damping(300e3, velocity, p) == pytest.approx(
            rest_force + 2e3 * velocity, rel=1e-12
        )
    assert repperger_damping(300e3, -1e3, p) == 0.0


def table_i3():
    table = load_table("I3")
    kept = table["pressure_nominal_kpa"] >= 200.0
    contraction = table["no_load_contraction_mm"] - table["extension_mm"]
    return [a[kept] for a in (table["pressure_nominal_kpa"], contraction, table["load_n"])]


@pytest.mark.parametrize(
    ("effect", "rms_n", "rms_mm"),
    [
        (SCHULTE_FORCE, 130.6, None),
        (SCHULZ_FORCE, 25.2, 1.14),
        (CHOU_HANNAFORD_FORCE, 136.5, None),
        (CALDWELL_FORCE, 131.0, None),
        (TONDU_LOPEZ_FORCE, 73.5, None),
        (SAROSI_FORCE, 12.8, 0.70),
        (COLBRUNN_SPRING, 36.6, 1.92),
        (REPPERGER_SPRING, 20.5, 0.95),
    ],
    ids=lambda value: getattr(value, "name", ""),
)
def test_what_each_law_leaves_of_table_i3_is_what_its_docstring_says(effect, rms_n, rms_mm):
    force, rows = muscle(effect), np.transpose(table_i3())
    assert len(rows) == 360
    wrong = [force(pressure, x) - load for pressure, x, load in rows]
    assert np.sqrt(np.mean(np.square(wrong))) == pytest.approx(rms_n, abs=0.05)
    assert f"{rms_n} N rms" in effect.law.__doc__
    if rms_mm is None:
        return
    away = [
        brentq(lambda s, at=pressure, pull=load: force(at, s) - pull, -24.0, 140.0) - x
        for pressure, x, load in rows
    ]
    assert np.sqrt(np.mean(np.square(away))) == pytest.approx(rms_mm, abs=0.005)
    assert f"{rms_mm:.2f} mm" in effect.law.__doc__


@pytest.mark.parametrize("effect", GEOMETRIC, ids=lambda effect: effect.name)
def test_without_pressure_only_the_tube_of_eq2_pulls_and_moves_the_no_load_contraction(effect):
    """Why Eq. 1, 3-5 stay beyond 70 N: I3's muscle contracts by 35 mm at 200 kPa, 65 at 575."""
    force, tube = law(effect), effect is SCHULZ_FORCE
    shortest = [brentq(lambda s, at=kpa: force(at, s), 0.0, 140.0) for kpa in (200.0, 575.0)]
    assert force(0.0, 40.0) < 0.0 if tube else force(0.0, 40.0) == 0.0
    assert shortest == pytest.approx(
        [35.0, 64.7] if tube else shortest[:1] * 2, abs=4.0 if tube else 1e-6
    )


@pytest.mark.parametrize("effect", SPRINGS, ids=lambda effect: effect.name)
def test_force_falls_with_contraction_and_rises_with_pressure(effect):
    """It is finite from a braid pulled straight to far beyond its stroke."""
    force = muscle(effect)
    for pressure in (200.0, 400.0, 575.0):
        along = [force(pressure, x) for x in np.linspace(-5.0, 60.0, 27)]
        assert np.all(np.diff(along) < 0.0)
    for x in (0.0, 20.0, 40.0):
        assert force(500.0, x) > force(300.0, x)
    beyond = [
        force(pressure, x) for pressure in (0.0, 600.0) for x in np.linspace(-100.0, 240.0, 35)
    ]
    assert np.isfinite(beyond).all()
