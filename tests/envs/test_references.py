"""Tasks whose reference is any function of time."""

import copy
import pickle
import re
from dataclasses import replace

import numpy as np
import pytest

from pma_gym.data.trial_schedule import Phase, TrialSchedule
from pma_gym.engine import engine_memory
from pma_gym.envs import EnvState, PMAEnv
from pma_gym.metrics import rmse
from pma_gym.tasks import TASKS, UNSEEN, following, multisine, phase_rmse, sine

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


def _slow_sine(generator):
    """A sine of a drawn frequency."""
    return sine("extension", frequency=float(generator.uniform(0.1, 0.4)))


def _wave(generator):
    """A task of a user's own, with a motion that only this episode has."""
    height = generator.uniform(2e-3, 10e-3)
    return following("wave", "extension", lambda time: height * np.sin(time) ** 2)


DRAWN = {
    "random": "random",
    "several": [f"displacement_{kind}" for kind in ("multisine", "sine", "steps_3", "speeds_4")],
    "function": _slow_sine,
    "lambda": _wave,
}
"""References that every reset draws, for a task of 10 s of extension."""


@pytest.fixture(params=DRAWN)
def drawn(request) -> dict:
    """Options of an environment that draws its reference."""
    reference = DRAWN[request.param]
    return {"task": "displacement_multisine", "reference": reference, "control_rate_hz": 20.0}


def _course(env) -> list[float]:
    return [env.reference(time) for time in np.arange(0.0, 10.0, 0.25).tolist()]


def test_every_reset_draws_a_reference_by_the_seed(make, drawn):
    env, seen = make(**drawn, preview=2, noise=False), []
    for seed in (*range(6), None):
        observation, _ = env.reset(seed=seed)
        seen.append(_course(env))
        assert env.task.schedule.at(3.0) == env.station.task.schedule.at(3.0) == env.reference(3.0)
        assert env.episode_summary()["task"] == env.task.name
        for _ in range(30):
            observation, *_, info = env.step(env.action(1.0))
        ahead = [env.reference(env.time + k / 20.0) for k in (0, 1, 2)]
        np.testing.assert_allclose(observation[[4, 6, 7]], np.array(ahead) / 25e-3, atol=1e-6)
        assert info["reference_mm"] == pytest.approx(ahead[0] * 1e3, abs=1e-12)
        assert env.error == pytest.approx(env.position - ahead[0], abs=1e-15)
    assert len({tuple(one) for one in seen}) > 2
    env.reset(seed=0)
    assert _course(env) == seen[0]
    other = make(**drawn)
    other.reset(seed=5)
    assert _course(other) == seen[5]
    other.reset()
    assert _course(other) == seen[6]


def test_the_score_is_that_of_the_drawn_reference(make, drawn):
    env = make(**drawn)
    for seed in (1, 2):
        info = run(env, seed)
        errors = phase_rmse(env.task.schedule, env.trajectory())
        assert info["rmse_mm"] == pytest.approx(1e3 * errors["all"], rel=1e-9)
        assert info["error_mm"] == pytest.approx(info["extension_mm"] - info["reference_mm"])


@pytest.mark.parametrize("precision", ["double", "single"])
def test_each_environment_of_a_batch_has_its_own_reference(batch, make, drawn, precision):
    made = {"control_rate_hz": 20.0, "precision": precision, "autoreset_mode": "SameStep"}
    envs = batch(9, **drawn | made, max_episode_steps=70)
    envs.reset(seed=3)
    members = [envs.member(i) for i in range(9)]
    tasks, first = [one.task for one in members], [_course(one) for one in members]
    single = make(**drawn)
    for _ in range(70):
        *_, info = envs.step(np.full((9, 1), -0.7))
    for i in (0, 7, 8):
        single.reset(seed=3 + i)
        assert _course(single) == first[i]
        single.reset()
        assert _course(single) == _course(members[i])
        # It is the episode of that task without a draw.
        own = batch(9, task=tasks[i], **made, max_episode_steps=70)
        own.reset(seed=3)
        for _ in range(70):
            *_, its = own.step(np.full((9, 1), -0.7))
        for key, numbers in info["final_info"].items():
            assert numbers[i] == its["final_info"][key][i]
    assert sum(_course(one) != course for one, course in zip(members, first, strict=True)) > 3


def test_states_and_copies_go_on_with_the_drawn_reference(make, batch, drawn, course, same):
    env = make(**drawn)
    env.reset(seed=4)
    course(env, 5)
    state, reference = env.get_state(), _course(env)
    ahead = course(env, 5)
    copies = copy.deepcopy(env), pickle.loads(pickle.dumps(env)), make(**drawn)
    for other in (env, *copies):
        other.reset(seed=9)
        other.set_state(EnvState.from_json(state.to_json()))
        assert _course(other) == reference
        assert same(course(other, 5), ahead)
    envs = batch(3, **drawn)
    envs.set_state(state)
    assert [_course(envs.member(i)) for i in range(3)] == [reference] * 3
    envs.reset(seed=4)
    drawn_by_seed = [_course(envs.member(i)) for i in range(3)]
    assert drawn_by_seed[0] == reference
    envs.reset(options={"reset_mask": np.array([False, True, False])})
    drawn_by_seed[1] = _course(envs.member(1))
    again = pickle.loads(pickle.dumps(envs))
    assert [_course(again.member(i)) for i in range(3)] == drawn_by_seed


def test_pictures_show_the_drawn_reference(make):
    env = make("displacement_steps", reference="random", noise=False, render_mode="rgb_array")
    pictures = []
    for seed in (0, 1, 0):
        env.reset(seed=seed)
        pictures.append(env.render())
    assert np.any(pictures[0] != pictures[1])
    np.testing.assert_array_equal(pictures[0], pictures[2])


@pytest.mark.parametrize(
    ("task", "reference", "words"),
    [
        ("displacement", "random", "another seed of a task such as displacement_multisine"),
        ("displacement_sine", "random", "task displacement_sine has none"),
        ("displacement", ["displacement_sine"], "make the environment with task displacement_sine"),
        ("displacement_sine", ["displacement_steps", "rotation_steps"], "rotation_steps differs"),
        ("isotonic_exercise", ["isotonic_exercise_6.5"], "isotonic_exercise_6.5 differs"),
        ("displacement_sine", sine("contraction"), "differs from task displacement_sine"),
        ("displacement_sine", ["displacment_steps"], "did you mean 'displacement_steps'?"),
        ("displacement_sine", [], 'must be "random", a task\'s name, a Task'),
        ("displacement_sine", lambda generator: 3, "that returns one, got 3"),
    ],
)
def test_references_of_another_kind_are_refused(task, reference, words):
    with pytest.raises(ValueError, match=re.escape(words)):
        PMAEnv(task, reference=reference)


def test_a_reference_that_fails_leaves_the_next_episode_the_same(make):
    def sometimes(generator):
        if fails:
            raise OSError("no file")
        return _slow_sine(generator)

    fails = False
    env = make("displacement_sine", reference=sometimes)
    env.reset(seed=1)
    fails = True
    with pytest.raises(OSError, match="no file"):
        env.reset()
    fails = False
    env.reset()
    other = make("displacement_sine", reference=_slow_sine)
    for seed in (1, None):
        other.reset(seed=seed)
    assert _course(env) == _course(other)
