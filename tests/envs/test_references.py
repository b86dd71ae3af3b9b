"""Tasks whose reference is any function of time."""

from dataclasses import replace

import numpy as np
import pytest

from pma_gym.data.trial_schedule import Phase, TrialSchedule
from pma_gym.engine import engine_memory
from pma_gym.envs import PMAEnv
from pma_gym.metrics import rmse
from pma_gym.tasks import TASKS, UNSEEN, following, multisine, phase_rmse

FACTORS = {"mm": 1e-3, "deg": np.pi / 180}


def volts(env: PMAEnv) -> float:
    """A pull that follows roughly, whatever the task."""
    return 1.0 + 3.0 * env.reference(env.time) / env.task.schedule.span


def run(env: PMAEnv, seed: int = 0) -> dict:
    env.reset(seed=seed)
    for _ in range(100_000):
        *_, terminated, truncated, info = env.step(env.action(volts(env)))
        if terminated or truncated:
            return info
    raise AssertionError("the episode never ended")


@pytest.mark.parametrize(
    ("name", "rate"), [("displacement_sine", 100.0), ("rotation_speeds", 37.0)]
)
def test_rmse_is_that_of_the_trajectory(make, name, rate):
    env = make(name, control_rate_hz=rate)
    info = run(env)
    unit = env.task.schedule.unit
    time = np.arange(3843) / 384.0
    # Two samples lie beyond the 10 s: the motion goes on for them, it does not stop.
    error = env.trajectory()[:3843] - env.task.schedule.motion(time)
    expected = rmse(error) / FACTORS[unit]
    assert info[f"rmse_{unit}"] == pytest.approx(expected, rel=1e-12)
    assert info[f"rmse_whole_{unit}"] == info[f"rmse_{unit}"]
    errors = phase_rmse(env.task.schedule, env.trajectory())
    assert errors["all"] / FACTORS[unit] == pytest.approx(expected, rel=1e-12)


def test_a_motion_that_is_a_line_scores_as_the_line(make):
    """The table of ideals and the constants of lines are two ways to one figure."""
    line = make("displacement")
    table = make(following("mine", "extension", _ramp, duration=5.0))
    first, second = run(line), run(table)
    assert second["rmse_mm"] == pytest.approx(first["rmse_mm"], rel=1e-12)
    assert second["time_s"] == first["time_s"]
    # The volts differ by the rounding of the reference.
    np.testing.assert_allclose(line.trajectory(), table.trajectory(), rtol=1e-9, atol=1e-15)


def _ramp(time):
    return 5e-3 * time


def test_phases_of_one_motion_are_scored_apart(make):
    bow = TrialSchedule(
        "bow", "extension", "mm", 10e-3,
        tuple(Phase(n, s, 1.5, 0.0, 0.0, _bow) for n, s in (("out", 0.0), ("back", 1.5))),
    )  # fmt: skip
    env = make(replace(TASKS["displacement"], name="bow", schedule=bow))
    info = run(env)
    error = env.trajectory()[:1155] - _bow(np.arange(1155) / 384.0)
    expected = {"out": rmse(error[:579]) * 1e3, "back": rmse(error[576:1155]) * 1e3}
    assert env.episode_summary()["rmse_by_phase_mm"] == pytest.approx(expected, rel=1e-12)
    assert (info["rmse_out_mm"], info["rmse_back_mm"]) == tuple(
        env.episode_summary()["rmse_by_phase_mm"].values()
    )


def _bow(time):
    return 4.4e-3 * time * (3.0 - time)


def test_references_of_one_structure_share_their_code(make, monkeypatch):
    libraries = {make(multisine("extension", seed))._engine.kernel.library for seed in range(4)}
    libraries.add(make("displacement_steps")._engine.kernel.library)
    assert len(libraries) == 1
    # A known name with other content has code of its own, and so has another range.
    impostor = replace(TASKS["displacement"], schedule=UNSEEN["displacement_sine"].schedule)
    assert make(impostor)._engine.kernel.library in libraries
    assert make("displacement")._engine.kernel.library not in libraries
    narrow = following("narrow", "extension", _ramp, span=10e-3)
    assert make(narrow)._engine.kernel.library not in libraries
    built: list[engine_memory.Kernel] = []
    monkeypatch.setattr(engine_memory, "Writer", built.append)
    make(multisine("extension", 99))
    assert built == []


@pytest.mark.parametrize("name", ["displacement_steps", "rotation_sine"])
def test_what_the_agent_sees_is_what_is_scored(make, name):
    env = make(name, preview=1, noise=False)
    observation, _ = env.reset(seed=0)
    schedule, span = env.task.schedule, env.task.schedule.span
    for _ in range(60):
        now = [schedule.at(env.time), schedule.at(env.time + 0.01)]
        np.testing.assert_allclose(observation[[4, 6]], np.array(now) / span, atol=1e-6)
        assert env.reference(env.time) == now[0]
        observation, *_, info = env.step(env.action(1.0))
        reference = info[f"reference_{schedule.unit}"] * FACTORS[schedule.unit]
        assert reference == pytest.approx(schedule.at(env.time), abs=1e-12)
        assert env.error == pytest.approx(env.position - reference, abs=1e-12)
