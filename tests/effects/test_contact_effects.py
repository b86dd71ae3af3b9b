"""Drag, springs, and what depends on direction or on the force of a drive, on slides and joints."""

import numpy as np
import pytest

from pma_gym import Plant
from pma_gym.data.trial import Trial
from pma_gym.effects import CATALOGUE
from pma_gym.plant.model import Model

INERTIA, TORQUE = 0.01, 0.5


def joint(**tables):
    """A joint with a torque drive, and effects by their tables in files."""
    given = {
        "torque_drive": {"gain": 1.0},
        **tables,
        "inertia": {"inertia_kg_m2": INERTIA},
        "joint_start": {"angle_deg": 0.0, "spin_deg_per_s": 0.0},
    }
    return Model("arm", "An arm", "joint", {n: CATALOGUE[n].parse(t) for n, t in given.items()})


def slide(**tables):
    """A slide on a drive of 100 N/V, and effects by their tables in files."""
    given = {
        "two_way_drive": {"gain_n_per_v": 100.0, "middle_v": 5.0},
        **tables,
        "slide": {"mass_kg": 2.0},
        "start": {"contraction_mm": 0.0, "velocity_mm_per_s": 0.0},
    }
    return Model("axis", "An axis", "slide", {n: CATALOGUE[n].parse(t) for n, t in given.items()})


def held(model, command, value, seconds=1.0):
    """Truth (SI) under a constant command."""
    time = np.linspace(0.0, seconds, 401)
    trial = Trial(time, {command: np.full(time.size, value)})
    return time, Plant(model).simulate(trial, noise=False).truth


def test_drag_lets_a_joint_run_up_to_where_it_takes_all_torque():
    time, truth = held(
        joint(joint_drag={"coefficient_n_m_s2": 0.02}), "torque_command", TORQUE, 3.0
    )
    final = np.sqrt(TORQUE / 0.02)
    run_up = final * np.tanh(time * np.sqrt(TORQUE * 0.02) / INERTIA)
    np.testing.assert_allclose(truth["speed"], run_up, atol=2e-4 * final)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_damping_and_gain_by_direction_are_larger_forwards(sign):
    damped = joint(
        joint_damping={"coefficient_n_m_s": 0.1},
        joint_directional_damping={"difference_n_m_s": 0.1},
    )
    _, truth = held(damped, "torque_command", sign * TORQUE, 4.0)
    assert truth["speed"][-1] == pytest.approx(sign * TORQUE / (0.1 + sign * 0.05), rel=1e-4)
    uneven = {"directional_gain": {"difference_percent": 20.0}}
    time, truth = held(joint(**uneven), "torque_command", sign * TORQUE)
    gained = sign * TORQUE * (1.0 + 0.1 * sign)
    np.testing.assert_allclose(truth["speed"], gained / INERTIA * time, rtol=1e-6)
    # A load pulls out: a negative one pushes forwards.
    _, truth = held(slide(**uneven), "load_command", -sign * 50.0, 0.2)
    forwards = sign * 50.0 * (1.0 + 0.1 * sign)
    assert truth["contraction"][-1] == pytest.approx(0.5 * forwards / 2.0 * 0.2**2, rel=1e-6)


@pytest.mark.parametrize(
    ("torque", "drive", "carried", "left"),
    [(0.2, 30.0, 0.0, 0.14), (1.0, 30.0, 0.0, 0.7), (2.0, 0.0, 30.0, 2.0 - 1.0 - 0.3)],
)
def test_friction_by_load_takes_a_share_of_the_drives_torque_or_of_what_is_carried(
    torque, drive, carried, left
):
    shares = {"drive_share_percent": drive, "carried_share_percent": carried}
    tables = {"joint_load_friction": shares | {"presliding_deg": 0.01}}
    tables |= {"constant_torque": {"torque_n_m": -1.0}} if carried else {}
    time, truth = held(joint(**tables), "torque_command", torque)
    slope = np.polyfit(time[100:], truth["speed"][100:], 1)[0]
    assert slope == pytest.approx(left / INERTIA, rel=1e-3)


@pytest.mark.parametrize("slope", [-8.0, 0.0, 8.0])
@pytest.mark.parametrize("rig", ["slide", "joint"])
def test_friction_over_position_takes_its_work_and_never_drives(rig, slope):
    """A rig that coasts; falling friction ends on its way, without a slope rates keep every bit."""
    make, start, friction, unit, command, place, speed, inertia = {
        "slide": (
            *(slide, {"start.velocity_mm_per_s": 300.0}, "coulomb_friction", 10.0),
            *("load_command", "contraction", "velocity", 2.0),
        ),
        "joint": (
            *(joint, {"joint_start.spin_deg_per_s": 1000.0}, "joint_friction", 1.8 / np.pi),
            *("torque_command", "angle", "speed", INERTIA),
        ),
    }[rig]
    dry = CATALOGUE[friction]
    rubbing = dry.values_in_files(dry.usual._replace(static=4.0, dynamic=4.0, presliding=2e-7))
    over = {"slide": "position_friction", "joint": "joint_position_friction"}[rig]
    (key,) = CATALOGUE[over].names_in_files()
    model = make(**{friction: rubbing, over: {key: slope}}).replace(start)
    _, truth = held(model, command, 0.0)
    # The level where it has not ended.
    x, s = truth[place], unit * slope
    end = np.minimum(x, -1.0 / s) if s < 0.0 else x
    energy = 0.5 * inertia * truth[speed] ** 2
    # Bristles store no more than their level over the distance in which they deflect.
    stored = 4.0 * (1.0 + s * x).max() * 2e-7
    work = 4.0 * (end + 0.5 * s * end**2)
    np.testing.assert_allclose(energy + work, energy[0], rtol=1e-5, atol=3.0 * stored)
    assert np.diff(energy).max() < stored
    if not slope:
        plants = Plant(model), Plant(make(**{friction: rubbing}))
        states = np.random.default_rng(0).standard_normal((20, len(plants[0].states)))
        rates, plain = (plant.derivative(states, 1.0, 0.0, 0.0) for plant in plants)
        np.testing.assert_array_equal(rates, plain)


TURNS = np.array([-10.0, -10.0, 3.0, 3.0, -7.0, 1.0, 1.0, -2.0, -2.0, 10.0])


def impulse(force, dt):
    """Integral of the amount of a force between rows that are joined linearly (N s)."""
    a, b = force[:-1], force[1:]
    turning = (a * a + b * b) / (2.0 * np.maximum(np.abs(b - a), 1e-300))
    return dt * np.where(a * b < 0.0, turning, 0.5 * np.abs(a + b))


@pytest.mark.parametrize("rig", ["slide", "joint"])
@pytest.mark.parametrize("effect", ["gain", "friction"])
def test_a_drive_that_turns_between_rows_is_integrated_exactly(rig, effect):
    """A slope that jumps behind a step's last stage shows in no error of it, at any tolerance."""
    make, friction, presliding, command, sign, start, inertia, speed = {
        "slide": (
            *(slide, "load_dependent_friction", {"presliding_um": 1e-3}, "load_command", -1.0),
            *({"start.velocity_mm_per_s": 300.0}, 2.0, "velocity"),
        ),
        "joint": (
            *(joint, "joint_load_friction", {"presliding_deg": 1e-4}, "torque_command", 1.0),
            *({"joint_start.spin_deg_per_s": 1000.0}, INERTIA, "speed"),
        ),
    }[rig]
    shares = {"drive_share_percent": 20.0, "carried_share_percent": 0.0}
    tables, share = {
        "friction": ({friction: shares | presliding}, -0.2),
        "gain": ({"directional_gain": {"difference_percent": 20.0}}, 0.1),
    }[effect]
    trial = Trial(2e-3 * np.arange(TURNS.size), {command: sign * TURNS})
    truth = Plant(make(**tables).replace(start), 1e-8).simulate(trial, noise=False).truth[speed]
    gained = 0.5 * (TURNS[:-1] + TURNS[1:]) * 2e-3 + share * impulse(TURNS, 2e-3)
    # The bristles deflect in the first of the intervals.
    assert (truth > 0.0).all()
    np.testing.assert_allclose(np.diff(truth)[1:], gained[1:] / inertia, rtol=1e-4)


def test_a_hardening_spring_swings_faster_where_it_swings_further():
    model = joint(joint_hardening_spring={"cubic_n_m_per_rad3": 2.0})
    periods = []
    for start in (20.0, 40.0):
        _, truth = held(
            model.replace({"joint_start.angle_deg": start}), "torque_command", 0.0, 12.0
        )
        falls = np.flatnonzero((truth["angle"][:-1] > 0.0) & (truth["angle"][1:] <= 0.0))
        periods.append(float(np.mean(np.diff(falls))))
    # Without a linear part the period is inverse to the amplitude.
    assert periods[0] / periods[1] == pytest.approx(2.0, rel=0.02)


def test_a_constant_torque_is_as_much_of_the_drives():
    model = joint(constant_torque={"torque_n_m": 0.1})
    _, pushed = held(model, "torque_command", 0.1)
    _, twice = held(joint(), "torque_command", 0.2)
    np.testing.assert_allclose(pushed["angle"], twice["angle"], rtol=1e-9)


@pytest.mark.parametrize(
    ("effect", "late"), [("drive_delay", "delay"), ("drive_lag", "time_constant")]
)
def test_a_late_drive_moves_a_joint_as_much_later(effect, late):
    time, truth = held(joint(), "torque_command", TORQUE, 0.5)
    ramp = Trial(time, {"torque_command": TORQUE * time})
    model = joint(**{effect: {"share": 1.0, f"{late}_ms": 10.0}})
    speeds = [Plant(each).simulate(ramp, noise=False).truth["speed"] for each in (joint(), model)]
    shifted = np.interp(time[100:] - 0.01, time, speeds[0])
    np.testing.assert_allclose(speeds[1][100:], shifted, atol=2e-3 * truth["speed"].max())


@pytest.mark.parametrize("share", [10.0, 25.0, 50.0])
def test_friction_by_load_leads_a_light_slide_by_less_than_its_encoder_reads(share):
    """Beside the integrator at a tolerance a million times as tight; 0.05 um over 8 s."""
    shares = {"drive_share_percent": share, "carried_share_percent": 0}
    damping = {"intercept_n_s_per_mm": 0.044, "slope_n_s_per_mm_per_kpa": 0.0}
    model = slide(
        load_dependent_friction=shares | {"presliding_um": 0.005}, symmetric_damping=damping
    ).replace({"two_way_drive.gain_n_per_v": 1.0, "slide.mass_kg": 1.84})
    time = np.arange(0.0, 8.0, 1e-3)
    tones = [(0.2, 1.5, 0.0), (0.3, 2.4, 1.0), (0.2, 3.9, 2.0)]
    load = sum(size * np.sin(2.0 * np.pi * f * time + p) for size, f, p in tones)
    trial = Trial(time, {"load_command": load})
    usual, exact = (
        plant.simulate(trial, noise=False).truth["contraction"]
        for plant in (Plant(model), Plant(model, 1e-10))
    )
    assert np.ptp(exact) > 1e-3
    assert np.sqrt(np.mean((usual - exact) ** 2)) < 5e-8
