"""What the regulator's lag makes impossible: the bounds' truths."""

import math

import numpy as np
import pytest

from benchmarks.exercise.lag.bounds import Foreknown, LagBounds, lag_of
from benchmarks.exercise.lag.causal import DEVIATIONS, PERIOD, Loop, causal_bound, causal_bounds
from benchmarks.exercise.lag.foreknown import foreknown_course, retimed
from benchmarks.exercise.lag.plots import bound_plot
from benchmarks.exercise.lag.points import points, rates
from benchmarks.exercise.lag.repeated_exercise import (
    LAG,
    NO_LAG,
    Exertion,
    RepeatedExercise,
    own_floor,
)
from benchmarks.exercise.lag.swing import swings
from benchmarks.exercise.lag.tables import bound_tables
from pma_gym.envs import PMAVectorEnv
from pma_gym.plant.model import load_model
from pma_gym.tasks.operator import PACED

STATION = load_model("station")
TYPICAL = PACED.typical
EXACT = TYPICAL._replace(unsteadiness=0.0, tremor=0.0, effort=1.0, reaction=0.15)


def exertion(lag, operator=EXACT, task="isokinetic_exercise", **more):
    return Exertion(task, 3, STATION.replace({LAG: lag}), operator=operator, **more)


@pytest.fixture(scope="module")
def point():
    return points("isokinetic_exercise", STATION)[4]


# -- foreknown -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def foreknown():
    """The exact operator's course by who knows it, by lag; blocks of 160 ms are enough for 1 %."""
    return {
        lag: foreknown_course(exertion(lag, pressure_kpa=300.0), blocks=(16,))
        for lag in (NO_LAG, lag_of(STATION, 4.0))
    }


def test_of_an_exact_operator_only_what_he_is_late_is_left(foreknown):
    floor = own_floor(exertion(NO_LAG, pressure_kpa=300.0))
    course = foreknown[NO_LAG].by_phase
    assert floor <= course["I"] < 1.02 * floor
    assert course["II"] < 0.1 and course["III"] < 0.1
    # Before he reacts nothing moves: the line alone, 18 deg/s for 0.15 s of the phase's 5 s.
    assert floor > 18.0 * math.sqrt(0.15**3 / (3.0 * 5.0))


def test_more_lag_is_never_better_and_costs_who_can_plan_hardly_anything(foreknown):
    quick, slow = (course.by_phase["I"] for course in foreknown.values())
    assert quick - 0.01 < slow < 1.02 * quick


def test_voltages_stay_within_what_a_regulator_takes_and_are_what_was_run(foreknown):
    course = foreknown[NO_LAG]
    assert course.voltages.min() >= 0.0 and course.voltages.max() <= 10.0
    again = RepeatedExercise(exertion(NO_LAG, pressure_kpa=300.0), 1).course(course.voltages)
    assert again.by_phase == course.by_phase


def test_a_moment_is_held_by_who_knows_the_course():
    task = "isotonic_exercise"
    start = RepeatedExercise(exertion(0.055, task=task), 1)
    before = start.course(np.full(start.steps, start.start_voltage()))
    course = foreknown_course(exertion(0.055, task=task), blocks=(16,))
    assert max(course.by_phase.values()) < 0.05 * max(before.by_phase.values())


def test_an_exercise_that_ends_early_is_no_beginning():
    strong = EXACT._replace(effort=5.0)
    with pytest.raises(ValueError, match=r"must bring the exercise to its end.*of 1501 steps"):
        foreknown_course(exertion(NO_LAG, strong, pressure_kpa=450.0))


def test_retimed_voltages_give_the_same_pressure():
    wanted = 5.0 + np.sin(np.linspace(0.0, 20.0, 500))
    there = retimed(wanted, 0.05, 0.1)
    assert retimed(there, 0.1, 0.05) == pytest.approx(wanted, abs=1e-9)
    assert np.abs(there - 5.0).max() > 1.05


# -- causal ----------------------------------------------------------------------------------------


def test_the_causal_bound_grows_with_lag_delay_and_noise():
    bounds = causal_bounds("isokinetic_exercise", STATION, (0.0, 1.0, 4.0), (0, 1))
    for sensed in (False, True):
        by_lag = {
            lag: [
                row.least for row in bounds if (row.lag, row.delay, row.sensed) == (lag, 1, sensed)
            ]
            for lag in sorted({row.lag for row in bounds})
        }
        none, own, slow = (np.array(least) for least in by_lag.values())
        assert (none < own).all() and (own < slow).all()
    least = {(row.point, row.lag, row.delay, row.sensed): row.least for row in bounds}
    for where, lag, delay, sensed in least:
        assert least[where, lag, delay, True] > least[where, lag, delay, False]
        assert least[where, lag, 1, sensed] >= 0.999 * least[where, lag, 0, sensed]
    assert all(row.least < row.uncontrolled for row in bounds)
    assert all(row.voltage < 1.01 * row.point.room / DEVIATIONS for row in bounds)


def test_simulated_spread_is_the_one_of_lyapunovs_equation(point):
    loop = Loop.of(point, rates(point, STATION), 1, TYPICAL)
    gain, generator = loop.gain(1e-2), np.random.default_rng(1)
    z, held = np.zeros((len(loop.a), 4000)), []
    for step in range(600):
        chance = np.outer(loop.by_chance, generator.standard_normal(z.shape[1]))
        z = loop.a @ z - np.outer(loop.by_voltage, gain @ z) + chance
        if step > 300 and step % 20 == 0:
            held.append(loop.output @ z)
    assert loop.deviations(gain, False)[0] == pytest.approx(float(np.std(held)), rel=0.03)


def test_no_other_law_does_better(point):
    loop = Loop.of(point, rates(point, STATION), 1, TYPICAL)
    price, generator = 1e-3, np.random.default_rng(1)

    def cost(law):
        output, voltage = loop.deviations(law, False)
        return output**2 + price * voltage**2

    best = loop.gain(price)
    for _ in range(20):
        other = best * (1.0 + 0.05 * generator.standard_normal(len(best)))
        assert cost(other) > cost(best) * (1.0 - 1e-9)


def test_the_station_wanders_as_the_linear_plant_less_what_friction_holds():
    steady, count = EXACT._replace(unsteadiness=TYPICAL.unsteadiness, fatigue=0.0), 64
    task = "isokinetic_exercise"
    environments = PMAVectorEnv(
        count, task, pressure_kpa=450.0, operator=steady, safety=False, noise=False
    )
    environments.reset(seed=1)
    volts = float(environments.engine.numbers("rest_regulator")[0])
    angles = []
    for step in range(round(10.0 / PERIOD)):
        environments.step(np.full((count, 1), volts / 5.0 - 1.0))
        if step > 8.0 / PERIOD:
            angles.append(environments.engine.numbers("rotation_deg"))
    wandered = float(np.mean(np.std(angles, axis=1)))
    near = next(
        p for p in points(task, STATION) if (p.angle, p.pressure) == (math.radians(85), 450e3)
    )
    linear = causal_bound(near, rates(near, STATION), NO_LAG, 0, False, steady).uncontrolled
    assert 0.6 * linear < wandered < linear


# -- swing -----------------------------------------------------------------------------------------


def test_the_whole_swing_at_rest_and_its_corner_at_the_lag():
    gain = STATION.parameters["regulator_line"].gain
    for swing in swings("profile_exercise", STATION):
        assert swing.pressure(0.0) == gain * min(swing.point.voltage, 10.0 - swing.point.voltage)
        assert swing.moment(0.0) == swing.point.influence * swing.pressure(0.0)
        corner = 1.0 / (2.0 * math.pi * swing.lag)
        assert swing.moment(corner) == pytest.approx(swing.moment(0.0) / math.sqrt(2.0))
        assert swing.most(swing.highest_frequency(1.0)) == pytest.approx(1.0)
        assert swing.highest_frequency(2.0 * swing.most(0.0)) == 0.0


def test_no_wave_of_a_mean_has_a_larger_fundamental(point):
    swing, turns = swings("isokinetic_exercise", STATION)[4], np.arange(4000) / 4000.0
    jumps = np.where(turns < point.voltage / 10.0, 10.0, 0.0)
    sine = point.voltage + point.room * np.sin(2.0 * math.pi * turns)
    reached = [2.0 * abs(np.fft.rfft(wave)[1]) / len(wave) for wave in (jumps, sine)]
    assert point.influence * swing.gain * np.array(reached) == pytest.approx(
        [swing.most(0.0), swing.moment(0.0)], rel=1e-3
    )
    assert swing.most(0.0) > swing.moment(0.0)


def test_the_linear_plants_pressure_swings_no_further(point):
    near, swing = rates(point, STATION), swings("isokinetic_exercise", STATION)[4]
    for frequency in (0.5, 2.0, 10.0):
        shifted = 2j * math.pi * frequency * np.eye(len(near.a)) - near.a
        pressure = near.seen[3] @ np.linalg.solve(shifted, near.by_voltage)
        # It vents more slowly than it fills, which the bound leaves out.
        assert 0.94 < point.room * abs(pressure) / swing.pressure(frequency) <= 1.0 + 1e-6


# -- all of it -------------------------------------------------------------------------------------


def test_tables_and_picture_name_every_point():
    task = "isokinetic_exercise"
    rows = Foreknown(task, 3, 300.0, 0.055, False, {"I": 3.1, "II": 0.01, "III": 0.01}, 3.0, 0.0, 9)
    bounds = LagBounds([rows], causal_bounds(task, STATION, (1.0,)), swings(task, STATION))
    foreknown, causal, reach = bound_tables(bounds)
    assert "| 0.055 | off | 1 | 3.100 | 0.010 | 0.010 |" in foreknown
    assert "30 deg, 300 kPa" in causal and "85 deg, 575 kPa" in reach
    assert len(bound_plot(bounds.causal, bounds.swings)) > 20_000


def test_only_exercises_have_such_bounds():
    with pytest.raises(ValueError, match="task must be an exercise, got rotation; take isokinetic"):
        points("rotation", STATION)
