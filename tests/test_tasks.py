"""Tasks: scores, rewards, limits."""

import math
from dataclasses import replace

import numpy as np
import pytest

from pma_gym.data.serres2008 import load_table
from pma_gym.data.trial_schedule import DISPLACEMENT, ROTATION
from pma_gym.metrics import phase_times
from pma_gym.plant.model import load_model
from pma_gym.tasks import (
    EVERY_TASK,
    EXERCISES,
    ISOTONIC,
    REWARDS,
    TASKS,
    TRIAL_TAIL_S,
    UNSEEN,
    broken,
    broken_limit,
    following,
    infeasibility_reason,
    isotonic,
    limit_in_words,
    missed_reward,
    multisine,
    named_task,
    phase_errors,
    phase_rmse,
    sine,
    speeds,
    steps,
)
from pma_gym.units import SI_FACTORS

SAMPLES = {"displacement": 1923, "rotation": 5763}


def ideal(name: str) -> np.ndarray:
    return TASKS[name].schedule.reference(np.arange(SAMPLES[name]) / 384.0)


def test_a_trial_lasts_to_its_last_sample():
    assert TRIAL_TAIL_S == pytest.approx(2 / 384)
    assert TASKS["displacement"].duration == pytest.approx(phase_times()[-1])
    assert TASKS["rotation"].duration == pytest.approx(phase_times(2)[-1])


@pytest.mark.parametrize("name", TASKS)
def test_the_ideal_has_no_error_but_past_the_ends_of_ramps(name):
    # A phase is scored on its own line, the reference turns: two samples of 5 ms are beyond.
    for phase, error in phase_errors(TASKS[name].schedule, ideal(name)).items():
        assert len(error) == 1923
        np.testing.assert_allclose(error[:1921], 0.0, atol=1e-12, err_msg=phase)


def test_a_constant_offset_is_the_rmse_of_every_phase():
    times = np.arange(5763) / 384.0
    offset = np.full_like(times, 0.01)
    known = phase_rmse(ROTATION, ROTATION.reference(times) + offset)
    assert list(known) == ["I", "II", "III", "all"]
    assert list(known.values()) == pytest.approx([0.01] * 4, rel=1e-2)


def test_phases_not_begun_are_left_out():
    assert list(phase_rmse(ROTATION, np.zeros(1000))) == ["I", "all"]
    assert list(phase_rmse(ROTATION, np.zeros(1921))) == ["I", "II", "all"]
    assert phase_rmse(DISPLACEMENT, np.zeros(1)) == {"displacement": 0.0, "all": 0.0}


def test_standing_still_misses_by_the_ramps_own_root_mean_square():
    # Root mean square of a line from 0 to 25 mm: 25 / sqrt(3).
    known = phase_rmse(DISPLACEMENT, np.zeros(1923))
    assert known["all"] == pytest.approx(0.025 / math.sqrt(3.0), rel=2e-3)


def test_rewards_are_best_without_an_error_and_even():
    for reward in REWARDS.values():
        assert reward(0.0, 0.0) == max(reward(e, 0.0) for e in np.linspace(-5, 5, 11))
        assert reward(1.7, 0.2) == reward(-1.7, 0.2)
        assert reward(2.0, 0.0) < reward(1.0, 0.0)


def test_a_missed_step_is_worth_no_more_than_the_worst_that_follows():
    for reward in REWARDS.values():
        assert missed_reward(reward) <= min(reward(e, 0.0) for e in np.linspace(-100, 100, 21))


def test_errors_are_given_in_percent_of_the_range():
    assert TASKS["displacement"].error_percent(0.25e-3) == pytest.approx(1.0)
    assert TASKS["rotation"].error_percent(math.radians(0.9)) == pytest.approx(1.0)


def test_names_of_tasks_are_their_keys():
    assert all(task.name == name for name, task in EVERY_TASK.items())
    assert len(EVERY_TASK) == len(TASKS) + len(UNSEEN) + len(ISOTONIC) + len(EXERCISES)


@pytest.mark.parametrize("task", UNSEEN.values(), ids=UNSEEN)
def test_unseen_references_begin_at_rest_and_stay_within_the_range(task):
    base = TASKS["rotation" if task.name.startswith("rotation") else "displacement"]
    assert (task.actuator, task.schedule.quantity) == ("motor", base.schedule.quantity)
    assert task.starts == base.starts and task.schedule.span == base.schedule.span
    assert task.steps(100.0) == 1001
    share = task.schedule.reference(np.arange(3841) / 384.0) / task.schedule.span
    assert share[0] == 0.0 and share.min() >= 0.0 and 0.6 < share.max() <= 0.95 + 1e-9
    if "sine" in task.name:
        assert abs(share[1] - share[0]) * 384.0 < 1e-3
    if "steps" not in task.name:
        # Five times the dissertation's speed at most, also while they fade in.
        assert np.abs(np.diff(share)).max() * 384.0 < 5 * 0.2


def test_drawn_tasks_are_known_by_their_number():
    task = named_task("rotation_multisine_17")
    assert task == multisine("rotation", 17) and task.name == "rotation_multisine_17"
    assert task != multisine("rotation", 18)
    assert (
        named_task("rotation_multisine").schedule.phases == multisine("rotation", 0).schedule.phases
    )
    assert named_task("displacement") is TASKS["displacement"]
    for name in ("rotation_sine_1", "displacement_steps_", "displacement_steps_01", "steps_1", ""):
        assert named_task(name) is None


@pytest.mark.parametrize("pressure", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("name", EVERY_TASK)
def test_the_station_can_follow_everything_but_steps_and_the_way_back_to_zero(name, pressure):
    task = EVERY_TASK[name]
    low, high = task.starts
    reason = infeasibility_reason(task, "station", low + pressure * (high - low))
    if name.endswith("steps"):
        jump = np.abs(np.diff(task.schedule.reference(np.arange(3841) / 384.0)))
        size = jump[jump > 0.0][0] / SI_FACTORS[task.schedule.unit]
        assert reason == f"the reference jumps by {size:.3g} {task.schedule.unit} at 0.5 s"
    elif name == "rotation":
        assert "the cable would have to push" in reason and "first at 14." in reason
    else:
        assert reason is None


def test_obstacles_say_what_is_lacking():
    far = following("far", "extension", _far, duration=4.0)
    assert "the motor would need more than 10 V" in infeasibility_reason(far, "station", 575e3)
    short = isotonic(stroke=30e-3)
    assert "the regulator would need more than 10 V" in infeasibility_reason(
        short, "station", 350e3
    )
    assert infeasibility_reason(short, "station", 150e3) is None
    with pytest.raises(ValueError, match="must be of a station"):
        infeasibility_reason(TASKS["displacement"], "cascade", 300e3)


def test_a_contraction_is_followed_by_the_regulator_under_a_load():
    task = sine("contraction")
    assert (task.actuator, task.load, task.starts) == ("regulator", 200.0, (150e3, 350e3))
    assert (task.name, task.schedule.span) == ("contraction_sine_2.5mm_0.4hz", 12.5e-3)
    assert infeasibility_reason(task, "station", 300e3) is None
    assert following("a", "contraction", _far, load=90.0).load == 90.0
    for make in (multisine, speeds, steps):
        assert make("contraction", 3).schedule.quantity == "contraction"


def _far(time):
    return 15e-3 * time


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (
            lambda: following("a", "load", _far),
            "quantity must be one of extension, rotation, contraction, got 'load'",
        ),
        (
            lambda: following("a", "extension", _far, load=100.0),
            "load must be.*0 where the motor moves, got 100",
        ),
        (lambda: following("a", "extension", np.cos), "must begin at 0.*got 1.*ramp it in"),
        (lambda: following("a", "extension", lambda t: t / (4.0 - t)), "finite"),
        (lambda: replace(TASKS["rotation"], actuator="regulator", load=9.0), "got rotation by the"),
        (lambda: replace(ISOTONIC["isotonic"], load=0.0), "positive load .*got 0.0 N"),
        (lambda: replace(TASKS["rotation"], load=100.0), "0 where the motor moves, got 100.0 N"),
    ],
)
def test_tasks_that_no_environment_can_do_are_refused(make, words):
    with np.errstate(divide="ignore"), pytest.raises(ValueError, match=words):
        make()


def test_the_isotonic_stroke_is_within_what_table_i3_shows():
    """Our choice of stroke, held against the measured contractions under about 205 N."""
    rows = load_table("I3").where(load_nominal_n=225)
    reached = {}
    for kpa in (350.0, 575.0):
        own = rows.where(pressure_nominal_kpa=kpa)
        reached[kpa] = np.mean(own["no_load_contraction_mm"] - own["extension_mm"])
    assert reached[350.0] == pytest.approx(39.2, abs=0.05)
    assert reached[575.0] == pytest.approx(55.9, abs=0.05)
    task = ISOTONIC["isotonic"]
    assert task.starts[1] == 350e3
    assert 1e3 * task.schedule.span < reached[575.0] - reached[350.0]


SAFE = {"contraction": 0.04, "load": 300.0, "pressure": 300e3}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({}, ""),
        ({"contraction": 0.0701}, "contraction above 70 mm"),
        ({"contraction": -0.0121}, "muscle stretched over 12 mm beyond its resting length"),
        ({"load": 1301.0}, "cable tension above 1300 N"),
        ({"pressure": 601e3}, "pressure above 600 kPa"),
        ({"contraction": math.nan}, "contraction above 70 mm"),
        ({"load": math.nan}, "cable tension above 1300 N"),
    ],
)
def test_limits_are_named(change, words):
    assert broken_limit(load_model("serres2008"), SAFE | change) == words


def test_the_first_limit_that_is_broken_counts():
    model = load_model("serres2008")
    limits = model.parameters["limits"]
    assert broken(limits, SAFE) == 0.0 and limit_in_words(model, 0.0) == ""
    all_of_them = {"contraction": 0.08, "load": 2000.0, "pressure": 700e3}
    assert broken(limits, all_of_them) == 1.0
    assert broken(limits, all_of_them | {"contraction": 0.04}) == 3.0
    assert broken(limits, SAFE | {"pressure": 700e3}) == 4.0
    assert limit_in_words(model, 4.0) == "pressure above 600 kPa"
