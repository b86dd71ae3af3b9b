"""`python -m benchmarks safety`: adversarial agents, and what they do to operators."""

import io

import numpy as np
import pytest
from rich.console import Console
from typer.testing import CliRunner

from benchmarks.__main__ import app
from benchmarks.executors.choice import local
from benchmarks.executors.executor import ThisProcess
from benchmarks.exercise.safety_episodes import (
    KINDS,
    PUMPING,
    SETS,
    kind_of,
    measure,
    planned,
    pumped,
)
from benchmarks.exercise.safety_layer import read_safety, run_safety, safety_text
from pma_gym.tasks import EXERCISES, PACED, PACING
from pma_gym.tasks.exercise import SAFE_MOMENT
from pma_gym.tasks.safety_filter import FILTER_PACED, FILTER_PACING, filtered_pressure

SAFE = {"safe_moment": 24.0, "safe_speed": 1.0}
CALM = {"pressure": 300e3, "moment": 8.0, "slow": 8.0, "speed": 0.0, "angle": 0.8}


@pytest.mark.parametrize("episode", range(len(KINDS)))
def test_an_agents_commands_are_its_seeds(episode):
    volts = planned(episode, 3, 1000, 0.01)
    np.testing.assert_array_equal(volts, planned(episode, 3, 1000, 0.01))
    assert volts.shape == (1000,) and volts.min() >= 0.0 and volts.max() <= 10.0
    kind = kind_of(episode)
    if kind in ("switching", "square wave", "0 or 10 V"):
        assert set(volts) <= {0.0, 10.0}
    assert (np.ptp(volts) == 0.0) == (kind in ("constant", "0 or 10 V", PUMPING))


def test_pumping_pulls_on_the_way_back_and_lets_go_on_the_way_out():
    assert pumped(np.array([1.0, -1.0, 0.0]), np.full(3, 4.0)).tolist() == [0.0, 10.0, 4.0]


def test_the_layer_saves_operators_from_wild_commands(tmp_path):
    said = io.StringIO()
    console = Console(file=said, width=120)
    safety = run_safety(
        episodes=42, bare=42, seed=0, out=tmp_path, console=console, executor=ThisProcess()
    )
    assert safety.total(True)[:2] == (42, 0)
    episodes, broken, _ = safety.total(False)
    assert episodes == 42 and broken > 21
    rows = {(task, stations, kind) for task in EXERCISES for stations in SETS for kind in KINDS}
    assert {(t.task, t.stations, t.agent) for t in safety.tallies} == rows
    assert all(t.episodes == 1 for t in safety.tallies)
    for tally in safety.tallies:
        if tally.safety:
            assert tally.peak_moment_nm <= SAFE_MOMENT
    assert read_safety(tmp_path / "safety.json") == safety
    assert "0 of 42 episodes were unsafe" in said.getvalue()
    assert safety_text(safety) in (tmp_path / "safety.md").read_text()


@pytest.mark.campaign
def test_what_comes_of_an_episode_does_not_depend_on_how_many_there_are():
    few = {(t.task, t.stations, t.agent): t for t in measure(14, 5, True, ThisProcess())}
    # The same counts from several processes.
    assert few == {(t.task, t.stations, t.agent): t for t in measure(14, 5, True, local(2))}
    more = {(t.task, t.stations, t.agent): t for t in measure(56, 5, True, ThisProcess())}
    for name, tally in few.items():
        assert more[name].peak_speed_deg_s >= tally.peak_speed_deg_s


@pytest.mark.parametrize("safety_filter", [FILTER_PACED, FILTER_PACING])
def test_what_changes_nothing_is_let_through(safety_filter):
    assert filtered_pressure(300e3, **CALM, **SAFE, safety_filter=safety_filter) == 300e3


@pytest.mark.parametrize("safety_filter", [FILTER_PACED, FILTER_PACING])
def test_the_faster_the_joint_the_less_is_let_through_that_way(safety_filter):
    def lowest(speed: float) -> float:
        return filtered_pressure(
            0.0, **(CALM | {"speed": speed}), **SAFE, safety_filter=safety_filter
        )

    def highest(speed: float) -> float:
        return filtered_pressure(
            1e6, **(CALM | {"speed": speed}), **SAFE, safety_filter=safety_filter
        )

    speeds = np.linspace(-0.9, 0.9, 19)
    assert all(np.diff([lowest(s) for s in speeds]) >= 0.0)
    assert all(np.diff([highest(s) for s in speeds]) >= 0.0)
    # Beyond its share of the safe speed the pressure turns against the motion.
    assert lowest(0.9) > 300e3 > highest(-0.9)


@pytest.mark.parametrize("safety_filter", [FILTER_PACED, FILTER_PACING])
def test_near_the_safe_moment_the_pressure_falls_whatever_is_asked(safety_filter):
    held = filtered_pressure(
        1e6, **(CALM | {"moment": 23.0, "slow": 23.0}), **SAFE, safety_filter=safety_filter
    )
    assert held < 300e3


def test_the_two_sorts_of_people_differ_in_effort_and_stiffness_alone():
    differing = {
        name for name in PACED.low._fields if getattr(PACED.low, name) != getattr(PACING.low, name)
    }
    assert differing == {"effort", "stiffness"}


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["--episodes", "0"], "--episodes must be a whole number from 1 on, got 0"),
        (["--bare", "-1"], "--bare must be a whole number from 0 on, got -1"),
        (["--out", "README.md"], "--out README.md is a file"),
    ],
)
def test_what_cannot_be_run_is_refused(given, message):
    result = CliRunner().invoke(app, ["safety", *given])
    assert result.exit_code == 2 and message in result.output
