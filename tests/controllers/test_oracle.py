"""The oracle: foresees what comes, knows the true station, and nothing of what is to come.

The achievable bound: below every controller, zero where the drive can give all.

The exact inverse is one of the ideal controllers and `ImprovedFeedforward` is the same: equal but
for the rounding of the times at which a voltage changes.
"""

from functools import lru_cache

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from benchmarks.bounds import achievable_bound
from controllers import CONTROLLERS, FeedforwardPID, ImprovedFeedforward, Oracle
from controllers.design.bounded_least_squares import Space, best_plan
from controllers.oracle import (
    HORIZON_S,
    LONGEST,
    PLANS,
    Commands,
    Prediction,
    block_lengths,
    horizon,
)
from pma_gym.envs import PMAEnv
from pma_gym.metrics import SAMPLE_RATE_HZ
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant
from pma_gym.plant.statics import Condition
from tests.controllers.conftest import trial

LATE = {"control_rate_hz": 50.0, "action_delay_s": 0.02}
DISTURBED = {"disturbances": "regulator_and_hand_push"}


# -- foresight -------------------------------------------------------------------------------------


def test_foresight_is_what_the_plant_does():
    plant = Plant("station")
    condition, regulator = plant.settle(3.0, pressure=300e3), plant.regulator_voltage(300e3)
    times = np.array([0.0, 0.01, 0.02, 0.05])
    volts = np.array([[4.0, 2.0, 3.0], [0.0, 10.0, 5.0]])
    seen = Prediction(plant, times)(condition, Commands(volts, regulator), 2)
    for plan, row in enumerate(volts):
        stepped = Condition(condition.state.copy(), condition.zero_contraction)
        for k, volt in enumerate(row):
            plant.step(stepped, volt, regulator, times[k + 1] - times[k])
            truth = plant.observe(stepped.state[None, :], stepped.zero_contraction)
            for name, scale in (("extension", 25e-3), ("rotation", 1.57), ("load", 500.0)):
                assert seen[name][plan, k] == pytest.approx(truth[name][0], abs=1e-4 * scale)


def test_what_is_foreseen_depends_on_no_other_plan_and_leaves_the_plant_alone():
    plant = Plant("station")
    condition = plant.settle(3.0, pressure=300e3)
    before = condition.state.copy()
    prediction = Prediction(plant, np.array([0.0, 0.01, 0.02]))
    volts = np.linspace(0.0, 10.0, PLANS)[:, None] * np.ones(2)
    together = prediction(condition, Commands(volts, 5.0), PLANS)["extension"].copy()
    alone = prediction(condition, Commands(volts[7:8], 5.0), 1)["extension"]
    assert np.array_equal(alone[0], together[7])
    assert np.array_equal(condition.state, before)


# -- search ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("limit", [10.0, 1.0])
def test_of_errors_linear_in_the_plan_it_finds_the_least_squares_within_limits(limit):
    # Periods 0, 1, 2-3 and 4-7 of an unstable guess, changed by blocks from a plan in the middle.
    generator, blocks = np.random.default_rng(1), np.array([0, 1, 2, 2, 3, 3, 3, 3])
    matrix, wanted = generator.normal(size=(20, 8)), 5.0 * generator.normal(size=20)
    plan, space = np.full(8, 5.0), Space(blocks, 5.0 - limit, 5.0 + limit)
    optimum = best_plan(
        lambda plans: (plans - 5.0) @ matrix.T - wanted, plan, plan[None, :] + 0.5, space
    )
    by_block = matrix @ np.eye(4)[blocks]
    expected = lsq_linear(by_block, wanted, (-limit, limit)).x
    assert optimum - 5.0 == pytest.approx(expected[blocks], abs=1e-5)


def test_the_plan_is_never_worse_than_any_start_and_passes_over_what_is_no_number():
    def errors(plans):
        return np.where(plans > 3.0, np.nan, np.cos(5.0 * plans) + 0.1 * plans**2)

    starts = np.array([[1.0], [4.0], [2.0]])
    optimum = best_plan(errors, np.zeros(1), starts, Space(np.zeros(1, int), 0.0, 5.0))
    best = min(float(errors(s) ** 2) for s in (0.0, *starts[:, 0]) if s <= 3.0)
    assert float(errors(optimum)[0] ** 2) <= best


def test_a_plan_is_held_to_the_limits_period_by_period():
    space = Space(np.array([0, 1, 1]), 1.0, 10.0)
    changed = space.changed(np.array([2.0, 3.0, 9.0]), np.array([[-5.0, 2.0]]))
    assert changed.tolist() == [[1.0, 5.0, 10.0]]
    assert space.starts.tolist() == [0, 1]


# -- horizon ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("rate", [50.0, 100.0, 384.0])
@pytest.mark.parametrize("delay", [0, 2])
def test_horizon_counts_every_scored_sample_once(rate, delay):
    ahead = horizon(1.0 / rate, delay)
    periods = sum(block_lengths(1.0 / rate))
    assert periods == LONGEST or periods / rate >= HORIZON_S
    assert np.sum(ahead.weights**2) == pytest.approx(len(ahead.blocks) * ahead.parts)
    assert ahead.parts == round(SAMPLE_RATE_HZ / rate)
    assert ahead.ends[-1] == len(ahead.blocks) * ahead.parts and np.all(np.diff(ahead.ends) > 0)
    assert ahead.ends[0] - ahead.parts * (1 - delay) <= 0 and ahead.ends[0] > -delay * ahead.parts


# -- the oracle ------------------------------------------------------------------------------------


def test_it_must_be_shown_the_environment(station):
    with pytest.raises(ValueError, match=r"must be shown the environment.*receive\(environment\)"):
        Oracle().reset(lambda time: 0.0, station())


@pytest.mark.parametrize(
    ("task", "pressure", "options"),
    [("displacement", 300, {}), ("displacement", 300, LATE), ("rotation", 400, LATE | DISTURBED)],
    ids=["100hz", "late", "hard"],
)
def test_it_beats_feedforward_and_feedback(task, pressure, options, drive):
    bound, _ = drive(Oracle(), task, pressure, **options)
    for rival in (ImprovedFeedforward(), FeedforwardPID()):
        got, _ = drive(rival, task, pressure, **options)
        assert all(bound[phase] < got[phase] for phase in bound)


def test_it_knows_a_station_that_is_not_its_model(drive):
    got, _ = drive(Oracle(), "displacement", 300, randomisation="varied")
    feedforward, _ = drive(ImprovedFeedforward(), "displacement", 300, randomisation="varied")
    assert got["displacement"] < 0.015 < 0.05 * feedforward["displacement"]


def test_it_commands_the_regulator_where_that_is_the_actuator(drive):
    for options in ({}, LATE):
        got, _ = drive(Oracle(), "triangle_low", 150, **options)
        feedforward, _ = drive(ImprovedFeedforward(), "triangle_low", 150, **options)
        assert all(got[phase] < 0.8 * feedforward[phase] for phase in got)


def test_no_noise_enters_it(drive):
    _, noisy = drive(Oracle(), "displacement", 300)
    _, other = drive(Oracle(), "displacement", 300, seed=2)
    _, silent = drive(Oracle(), "displacement", 300, noise=False)
    assert np.array_equal(noisy, silent) and np.array_equal(noisy, other)


def test_it_does_not_know_disturbances_to_come(drive):
    env = PMAEnv("displacement", pressure_kpa=300.0, disturbances="regulator")
    trial(Oracle(), env)
    _, calm = drive(Oracle(), "displacement", 300)
    disturbed = env.voltages
    # It comes with this step, whose command is given before it.
    step = int(np.ceil(env.events.step_times[0] / env.options.period))
    assert np.array_equal(calm[: step + 1], disturbed[: step + 1])
    assert calm[step + 1] != disturbed[step + 1]


RIVALS = [
    make
    for make in CONTROLLERS.values()
    if not hasattr(make, "receive") and "rotation" in getattr(make, "kinds", ["rotation"])
]

bound_of = lru_cache(achievable_bound)


@pytest.mark.campaign
@pytest.mark.parametrize(("task", "pressure"), [("rotation", 400), ("displacement", 300)])
def test_no_controller_comes_closer(task, pressure, drive):
    bound = bound_of("station", task, pressure)
    for make in RIVALS:
        got, _ = drive(make(), task, pressure)
        assert all(bound[phase] <= 1.02 * got[phase] for phase in bound)


@pytest.mark.campaign
def test_phase_three_is_limited_by_what_the_drive_cannot_push():
    # More friction of the rotor brakes it sooner where the cable hangs loose.
    model = load_model("station")
    braked = model.replace({"rotor.damping_n_m_s": 7.64e-3})
    free = bound_of("station", "rotation", 400)["III"]
    assert achievable_bound(braked, "rotation", 400)["III"] > 3.0 * free > 0.0


@pytest.mark.campaign
def test_cascade_that_is_pushed_and_pulled_alike_has_no_floor():
    bound = achievable_bound("cascade", "rotation", 300)
    assert np.all(np.array(list(bound.values())) < 0.005)
