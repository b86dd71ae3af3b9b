"""The exercise device: an operator whom the motor plays, and a regulator that resists him."""

import math
from dataclasses import replace

import numpy as np
import pytest

from pma_gym.codegen.random import normals, philox
from pma_gym.envs import PMAEnv
from pma_gym.plant.exercise_device.device import own_device, resistive_moment
from pma_gym.plant.exercise_device.knee import knee_share
from pma_gym.plant.exercise_device.prescription import UnreachableError
from pma_gym.plant.model import load_model
from pma_gym.plant.statics import contraction_at, muscle_force
from pma_gym.tasks import (
    EXERCISES,
    PACE,
    PACED,
    PACING,
    OperatorState,
    moment_exercise,
    phase_rmse,
)
from pma_gym.tasks.operator import FORESIGHT_S, operator_step

EXACT = PACED.typical._replace(effort=1.0, unsteadiness=0.0, tremor=0.0, fatigue=0.0, stiffness=0.0)
"""Somebody who gives just what the device takes."""


def held(env: PMAEnv, seconds: float = 100.0) -> list[dict]:
    """Infos of an episode, or of its start, in which the regulator holds the first pressure."""
    infos, volts, over = [], env.regulator_voltage, False
    while not over and env.time < seconds - 1e-9:
        _, _, terminated, truncated, info = env.step(env.action(volts))
        infos.append(info)
        over = terminated or truncated
    return infos


@pytest.mark.parametrize(
    ("model", "name"),
    [("station", name) for name in EXERCISES],
)
def test_nothing_moves_before_the_operator_reacts_to_the_cue(name, model):
    # A unit step of the pressure would move the joint; a balance does not.
    env = PMAEnv(name, model=model, operator=EXACT._replace(reaction=1.0, stiffness=20.0))
    _, info = env.reset(seed=3)
    start = env.task.exercise.start_moment
    assert info["moment_nm"] == pytest.approx(start, abs=1e-9) == info["operator_nm"]
    assert env.truth["rotation"] == 0.0
    for info in held(env, 1.0):
        assert abs(info["speed_deg_s"]) < 1e-4 and info["moment_nm"] == pytest.approx(
            start, abs=1e-5
        )
    assert abs(math.degrees(env.truth["rotation"])) < 1e-5


@pytest.mark.parametrize("pressure_kpa", [275.0, 575.0])
def test_who_gives_what_the_device_takes_turns_the_joint_as_he_means_to(pressure_kpa):
    env = PMAEnv("isokinetic_exercise", operator=EXACT, pressure_kpa=pressure_kpa)
    env.reset(seed=0)
    infos = held(env)
    # At rest near 90 deg: 17 N of hysteresis, once at its start on the branch of filling and once
    # as the muscle is stretched, hold it short by some 4 deg at the low pressure.
    end_of_hold = infos[999]
    assert end_of_hold["rotation_deg"] == pytest.approx(90.0, abs=4.5)
    model = env.station.model
    part, radius = model.parameters, own_device(model).radius
    force, hysteresis, cable = muscle_force(model), part["hysteresis"], part["cable"]
    pressure = np.array([1e3 * pressure_kpa])
    branch = hysteresis.force * hysteresis.memory_at_start
    start = contraction_at(lambda p, x: force(p, x) - branch, pressure, np.zeros(1))
    wound = radius * math.radians(end_of_hold["rotation_deg"]) - cable.slack - start

    def unbalanced(p, x):
        return force(p, x) + hysteresis.force - cable.stiffness * np.maximum(0.0, wound + x)

    stretched = contraction_at(unbalanced, pressure, np.zeros(1))
    moment = radius * float((force(pressure, stretched) + hysteresis.force)[0])
    # Dry friction, and what hysteresis loses as the joint comes back a little: 0.135 N m measured.
    free = radius * (part["coulomb_friction"].static + 0.2 * hysteresis.force)
    assert end_of_hold["moment_nm"] == pytest.approx(moment, abs=free)


@pytest.mark.parametrize("name", EXERCISES)
def test_the_compiled_operator_is_the_plain_one(name):
    env = PMAEnv(name)
    env.reset(seed=8)
    operator, exercise = env.operator, env.task.exercise
    plan = exercise.prescription
    if plan is None:
        angles = np.radians(np.arange(0.0, 91.0, 15.0))
        given = resistive_moment(
            env.station.model, own_device(env.station.model), env.pressure, angles
        ).moment
    mind, key = OperatorState(exercise.start_moment, 0.0, 1.0), env._engine._keys[0]
    words = tuple(np.array([int(word)], np.uint64) for word in key)
    zero = np.zeros(1, np.uint64)
    for k in range(400):
        time, angle = k * env.options.period, env.truth["rotation"]
        intended = float(PACE.reference(max(0.0, time - operator.reaction)))
        expected = plan.at(intended) if plan else float(np.interp(intended, angles, given))
        normal = float(
            normals(philox((zero + np.uint64(k), zero, zero + np.uint64(1), zero), words))[0][0]
        )
        speed = env._number("spin")
        moment, mind = operator_step(
            operator,
            mind,
            operator.effort * expected,
            intended - angle,
            angle + FORESIGHT_S * speed,
            time,
            normal,
            env.options.period,
            -math.expm1(-env.options.period / operator.rise),
        )
        *_, info = env.step(env.action(5.0 + 3.0 * math.sin(time)))
        assert info["operator_nm"] == pytest.approx(moment, rel=1e-9, abs=1e-9)
        able = mind.freshness * operator.strength * knee_share(angle + FORESIGHT_S * speed)
        assert 0.0 <= info["operator_nm"] <= able * (1.0 + 1e-3)


def test_nobody_pushes_the_leg_beyond_straight():
    env = PMAEnv("isokinetic_exercise", safety=False, operator=EXACT._replace(effort=5.0))
    env.reset(seed=0, options={"pressure_kpa": 275})
    angles = []
    for _ in range(700):
        *_, terminated, _, info = env.step(env.action(4.0))
        angles.append(info["rotation_deg"])
        if terminated:
            break
    assert max(angles) < 98.0


def test_the_weak_do_not_come_up():
    env = PMAEnv("isokinetic_exercise", operator=EXACT._replace(strength=60.0))
    env.reset(seed=0, options={"pressure_kpa": 450})
    assert held(env, 9.0)[-1]["rotation_deg"] < 85.0


def test_who_tires_gives_less_where_it_is_all_that_he_can():
    last = []
    for rate in (0.0, 2.0 / 60.0):
        someone = EXACT._replace(strength=80.0, fatigue=rate)
        env = PMAEnv("isokinetic_exercise", operator=someone, pressure_kpa=450)
        env.reset(seed=0)
        last.append(held(env, 10.0)[-1]["rotation_deg"])
    assert last[1] < last[0] - 0.3


def test_a_heavier_leg_swings_more_slowly():
    # A torsional pendulum: the period goes with the root of the inertia.
    def crossings(inertia: float) -> float:
        model = load_model("serres2008").with_effects(
            {"leg": {"inertia_kg_m2": inertia, "damping_n_m_s": 0.0}}
        )
        model = model.replace({f"coulomb_friction.{what}_n": 0.0 for what in ("static", "dynamic")})
        env = PMAEnv(
            "rotation", model=model, noise=False, pressure_kpa=400.0, control_rate_hz=200.0
        )
        env.reset(seed=0)
        speeds = []
        for _ in range(1800):
            env.step(env.action(5.0))
            speeds.append(env._number("spin"))
        turns = np.flatnonzero(np.diff(np.sign(speeds)) != 0)
        return float(np.diff(turns)[:2].mean())

    assert crossings(4.0) / crossings(1.0) == pytest.approx(2.0, rel=0.06)


def test_the_excess_is_the_moment_less_what_is_prescribed():
    env = PMAEnv("profile_exercise", control_rate_hz=96.0)
    env.reset(seed=2)
    infos = held(env, 6.0)
    plan = env.task.exercise.prescription
    radius = env.station.model.parameters["rotor"].radius
    for info in infos:
        prescribed = plan.at(math.radians(info["rotation_deg"]))
        assert info["prescribed_nm"] == pytest.approx(prescribed, rel=1e-9)
        assert info["moment_nm"] == pytest.approx(radius * info["load_n"], rel=1e-12)
        assert info["excess_nm"] == pytest.approx(info["moment_nm"] - prescribed, abs=1e-9)
        assert info["power_w"] == pytest.approx(
            info["moment_nm"] * math.radians(info["speed_deg_s"]), abs=1e-9
        )
    # Every fourth sample at 384 Hz is a control step's end.
    sampled = env.trajectory()[4 : 4 * len(infos) : 4]
    np.testing.assert_allclose(sampled, [i["excess_nm"] for i in infos[: len(sampled)]], atol=2e-3)


@pytest.mark.parametrize("name", EXERCISES)
def test_scores_are_those_of_the_course(name):
    env = PMAEnv(name)
    env.reset(seed=5)
    infos = held(env)
    last, unit = infos[-1], env.task.schedule.suffix
    course = phase_rmse(env.task.schedule, env.trajectory())
    factor = math.pi / 180.0 if unit == "deg" else 1.0
    by_phase = {name: course[name] / factor for name in ("I", "II", "III")}
    assert {n: last[f"rmse_{n}_{unit}"] for n in by_phase} == pytest.approx(by_phase, rel=1e-9)
    assert last["peak_moment_nm"] == max(info["moment_nm"] for info in infos)
    assert last["peak_speed_deg_s"] == pytest.approx(max(abs(i["speed_deg_s"]) for i in infos))
    assert last["peak_power_w"] == max(abs(info["power_w"]) for info in infos)
    work = sum(info["power_w"] for info in infos) * env.options.period
    assert last["work_j"] - last["returned_j"] == pytest.approx(work, rel=1e-9)
    rotation = np.array([info["rotation_deg"] for info in infos[:1500]])
    ideal = np.degrees(PACE.reference(0.01 * np.arange(1, 1501)))
    pace = math.sqrt(np.mean((rotation - ideal) ** 2))
    assert last["pace_rmse_deg"] == pytest.approx(pace, rel=1e-9)


def test_people_are_drawn_within_their_ranges_and_by_the_seed():
    envs = [PMAEnv("isotonic_exercise") for _ in range(2)]
    seen = []
    for seed in range(30):
        for env in envs:
            env.reset(seed=seed)
        assert envs[0].operator == envs[1].operator
        seen.append(envs[0].operator)
        envs[1].reset()
        assert envs[1].operator != envs[0].operator
    drawn = np.array(seen)
    assert np.all(drawn >= PACING.low) and np.all(drawn <= PACING.high)
    spread = np.array(PACING.high) - np.array(PACING.low)
    assert np.all(np.ptp(drawn, axis=0)[spread > 0.0] > 0.6 * spread[spread > 0.0])
    env = PMAEnv("isotonic_exercise", operator="typical")
    env.reset(seed=1)
    assert env.operator == PACING.typical
    assert PMAEnv("displacement").operator is None


def adversarial(env: PMAEnv, seed: int) -> dict:
    """The last info of an episode in which the regulator is thrown from end to end."""
    generator = np.random.default_rng(seed)
    env.reset(seed=seed)
    for k in range(1501):
        if k % 25 == 0:
            action = generator.choice([-1.0, 1.0], 1)
        *_, terminated, truncated, info = env.step(action)
        if terminated or truncated:
            return info
    raise AssertionError("an episode must end")


@pytest.mark.parametrize("name", EXERCISES)
def test_the_safety_layer_keeps_wild_commands_from_harm(name):
    ends = {}
    for safety in (True, False):
        env = PMAEnv(name, safety=safety)
        ends[safety] = []
        for seed in range(4):
            adversarial(env, seed)
            ends[safety].append(env.ended_by)
    assert ends[True] == [""] * 4
    assert all("joint" in end for end in ends[False])


def test_what_is_not_safe_ends_an_episode():
    env = PMAEnv(
        "isotonic_exercise", safety=False, operator=PACING.typical._replace(stiffness=60.0)
    )
    env.reset(seed=0)
    for _ in range(1501):
        _, reward, terminated, _, info = env.step(env.action(env.regulator_voltage))
        if terminated:
            break
    assert env.ended_by == "moment at the joint above the safe 24 N m"
    assert info["moment_nm"] > 24.0 and reward < -1e4
    fast = replace(env.task, exercise=replace(env.task.exercise, safe_speed=math.radians(10.0)))
    env = PMAEnv(fast, safety=False)
    env.reset(seed=0)
    assert held(env)[-1]["limit_code"] == 6
    assert env.ended_by == "joint faster than the safe 10 deg/s"


def test_the_observation_of_a_prescription_is_of_the_moment():
    env = PMAEnv("profile_exercise", operator="typical")
    env.reset(seed=4)
    assert "prescribed moment at the measured angle" in env.table.describe()
    volts = env.regulator_voltage
    for _ in range(300):
        observation, *_ = env.step(env.action(volts))
    reading, station, span = env.measurement, env.station, env.task.schedule.span
    plan = env.task.exercise.prescription
    assert observation[4] == pytest.approx(plan.at(reading.rotation) / span, rel=1e-6)
    assert observation[5] == pytest.approx(-station.position(reading) / span, rel=1e-5)
    assert station.moment(reading) == pytest.approx(env._number("moment_nm"), abs=0.1)


@pytest.mark.parametrize(
    ("task", "options", "message"),
    [
        (
            "isotonic_exercise_20",
            {},
            r"at 525 kPa, where one moment can be held .* from \d.* to \d",
        ),
        ("isotonic_exercise_99", {}, r"must lie between 0 and the safe 24 N m, got \[99.0\]"),
        ("isokinetic_exercise", {"control_rate_hz": 20.0}, "at least 50 Hz .* got 20 Hz"),
        ("isotonic_exercise", {"preview": 3}, "goes by the angle: leave the option out, got 3"),
        ("isokinetic_exercise", {"model": "cascade"}, "needs the model of a station"),
        (
            "isokinetic_exercise",
            {"operator": "strong"},
            r"operator must be one of random, typical or a pma_gym.tasks.Operator",
        ),
        ("isokinetic_exercise", {"safety": 1}, "safety must be true or false, got 1"),
        (
            "rotation",
            {"operator": "typical"},
            "operator is an option of exercises, and task rot",
        ),
        ("rotation", {"safety": False}, "safety is an option of exercises, and task rot"),
        ("isokinetic_exercise", {"pressure_kpa": 150}, "must lie in .* reaches 90 deg, got 150"),
        ("isokinetic_exercise", {"regulator_action": True}, "is the regulator's already"),
        (
            "isokinetic_exercise",
            {"operator": EXACT._replace(strength=2000.0)},
            r"operator.strength must be a number in 1-600 N m, got 2000.0",
        ),
    ],
)
def test_refusals_say_what_can_be_had(task, options, message):
    with pytest.raises(ValueError, match=message):
        PMAEnv(task, **options)


def test_pressures_of_an_episode_are_checked_too():
    env = PMAEnv("isotonic_exercise", pressure_kpa=550)
    with pytest.raises(UnreachableError, match="at 200 kPa, where no one moment can be held"):
        env.reset(options={"pressure_kpa": 200})
    env.reset(options={"pressure_kpa": 575})


@pytest.mark.parametrize(
    ("angles", "moments", "pressures", "message"),
    [
        ([0.0], [5.0], (550e3, 450e3), r"in Pa \(kPa times 1000\) from 0 on, the lower first"),
        ([0.0], [5.0], (-5e3, 450e3), r"from 0 on, the lower first, got \(-5000.0, 450000.0\)"),
        ([0.0, 90.0], [5.0, 8.0], (450e3, 550e3), r"to 2.09 rad at most \(deg times pi / 180\)"),
        ([0.0, math.nan], [5.0, 8.0], (450e3, 550e3), "must rise from 0"),
        ([0.0, 1.0], [5.0], (450e3, 550e3), "got 1 moments and 2 angles"),
    ],
)
def test_slips_in_a_task_of_ones_own_are_told(angles, moments, pressures, message):
    with pytest.raises(ValueError, match=message):
        moment_exercise(angles, moments, pressures)


def test_a_task_of_ones_own_takes_arrays():
    mine = moment_exercise(np.radians([0, 90]), np.array([5, 8]), (450e3, 550e3))
    env = PMAEnv(mine)
    assert env.operator is None
    env.reset(seed=1)
    assert env.task.exercise.prescription.at(math.radians(45.0)) == pytest.approx(6.5)
    with pytest.raises(AttributeError, match="collect info"):
        _ = env.motor_voltages
