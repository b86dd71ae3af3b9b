"""The figures of an episode: against known motions, voltages and limits."""

import json
import math

import numpy as np
import pytest

from benchmarks.runner.figures import (
    REACH,
    TOLERANCE,
    WATCHED,
    Episode,
    Figures,
    figures,
    violation,
)
from pma_gym.data.serres2008 import load_table
from pma_gym.envs import PMAEnv
from pma_gym.metrics import SAMPLE_RATE_HZ
from pma_gym.plant.model import load_model
from pma_gym.tasks import TASKS

LIMITS = load_model("station").parameters["limits"]
CALM = {"contraction": [0.03], "load": [100.0], "pressure": [3e5]}


def episode(task, error, voltages=(1.0, 2.0), truth=CALM, act_seconds=(1e-6,)):
    """An episode whose position is off the ideal by `error` (m or rad) by time (s)."""
    schedule = TASKS[task].schedule
    last = schedule.phases[-1]
    time = np.arange(last.first + last.samples) / SAMPLE_RATE_HZ
    position = np.empty(len(time))
    for phase in schedule.phases:
        own = slice(phase.first, phase.first + phase.samples)
        position[own] = phase.reference(phase.times)
    return Episode(position + error(time), voltages, truth, act_seconds)


def figures_of(task, *given, **named):
    return figures(TASKS[task], episode(task, *given, **named), 0.01, LIMITS)


def test_constant_error_is_every_rmse():
    scores = figures_of("displacement", lambda time: 0.25e-3 + 0.0 * time)
    wanted = pytest.approx(0.25, rel=1e-12)
    assert scores.unit == "mm"
    assert (scores.rmse, scores.start_rmse, scores.steady_rmse) == (wanted, wanted, wanted)
    phase = scores.phases["displacement"]
    assert (phase.rmse, phase.largest_error) == (wanted, wanted)
    assert phase.percent_of_range == pytest.approx(1.0, rel=1e-12)


def test_start_is_the_first_half_second_and_the_rest_is_steady():
    scores = figures_of("displacement", lambda time: np.where(time < 0.5, 2e-3, 1e-3))
    assert scores.start_rmse == pytest.approx(2.0, rel=1e-12)
    assert scores.steady_rmse == pytest.approx(1.0, rel=1e-12)
    # 192 of the 1923 samples lie before 0.5 s.
    assert scores.rmse == pytest.approx(math.sqrt((192 * 4.0 + 1731) / 1923), rel=1e-12)


def test_phases_are_those_of_the_environment():
    env = PMAEnv("rotation", pressure_kpa=300, noise=False)
    env.reset(seed=1)
    ended, volts, truth = False, [], {name: [] for name in CALM}
    while not ended:
        *_, broken, over, info = env.step(env.action(0.4 * env.time))
        ended = broken or over
        volts.append(env.motor_voltage)
        for name in truth:
            truth[name].append(env.truth[name])
    scores = figures(env.task, Episode(env.trajectory(), volts, truth, [1e-5]), 0.01, LIMITS)
    assert {n: p.rmse for n, p in scores.phases.items()} == pytest.approx(
        env.episode_summary()["rmse_by_phase_deg"], rel=1e-9
    )
    assert scores.rmse == pytest.approx(info["rmse_deg"], rel=1e-9)


def test_effort_is_that_of_a_known_voltage():
    # A square wave between 4 and 6 V: standard deviation 1 V, a jump of 2 V every 10 ms.
    volts = np.tile([4.0, 6.0], 250)
    scores = figures_of("displacement", lambda time: 0.0 * time, voltages=volts)
    assert scores.effort_v == pytest.approx(1.0, rel=1e-12)
    assert scores.variation_v_per_s == pytest.approx(499 * 2.0 / 5.0, rel=1e-12)
    assert scores.saturation_share == 0.0


def test_saturation_counts_steps_at_either_limit():
    scores = figures_of("displacement", lambda time: 0.0 * time, voltages=[0.0, 10.0, 9.99, 5.0])
    assert scores.saturation_share == 0.5


def test_times_are_the_median_and_the_99th_percentile():
    seconds = np.arange(1, 101) * 1e-6
    scores = figures_of("displacement", lambda time: 0.0 * time, act_seconds=seconds)
    assert scores.act_us == pytest.approx(50.5)
    assert scores.act_us_worst == pytest.approx(99.01)


def test_soft_limits_are_the_reach_of_table_i3():
    table = load_table("I3")
    stretch = np.nanmax(table["extension_mm"] - table["no_load_contraction_mm"])
    assert REACH["contraction"] == pytest.approx(np.nanmax(table["no_load_contraction_mm"]) * 1e-3)
    assert REACH["stretch"] == pytest.approx(stretch * 1e-3)
    assert REACH["tension"] == np.nanmax(table["load_nominal_n"])
    assert REACH["pressure"] == np.nanmax(table["pressure_nominal_kpa"]) * 1e3
    assert all(REACH[name] < getattr(LIMITS, name) for name in REACH)


@pytest.mark.parametrize(
    ("name", "signal", "sign"),
    [("tension", "load", 1.0), ("stretch", "contraction", -1.0), ("pressure", "pressure", 1.0)],
)
def test_violation_runs_from_the_soft_to_the_hard_limit(name, signal, sign):
    hard, soft = getattr(LIMITS, name), REACH[name]

    def at(value):
        return violation([name], CALM | {signal: [0.0, sign * value, 0.0]}, LIMITS)

    assert at(soft + 0.9 * TOLERANCE * hard) == 0.0
    assert at(0.5 * (soft + hard)) == pytest.approx(0.5)
    assert at(hard) == pytest.approx(1.0)


def test_a_controller_of_the_motor_is_not_blamed_for_the_pressure():
    high = CALM | {"pressure": [599e3]}
    assert violation(WATCHED["motor"], high, LIMITS) == 0.0
    assert violation(WATCHED["regulator"], high, LIMITS) > 0.9


def test_rows_keep_every_bit():
    scores = figures_of("rotation", lambda time: 1e-3 * np.sin(time) / 3.0)
    row = {"controller": "pid", **json.loads(json.dumps(scores.to_json()))}
    assert Figures.from_json(row) == scores
    assert list(scores.to_json()["phases"]) == ["I", "II", "III"]


def test_a_trial_that_ended_early_has_no_figures():
    whole = episode("rotation", lambda time: 0.0 * time)
    for samples in (100, len(whole.position) - 1):
        short = whole._replace(position=whole.position[:samples])
        with pytest.raises(ValueError, match=r"phase \w+ needs 1923 samples at 384 Hz, got"):
            figures(TASKS["rotation"], short, 0.01, LIMITS)
