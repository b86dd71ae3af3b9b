"""How long episodes are: `max_episode_steps`, specs, Gymnasium's TimeLimit, and the last info."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.wrappers import RecordEpisodeStatistics, TimeAwareObservation, TimeLimit

from pma_gym.envs import ENVIRONMENTS, PMAEnv
from pma_gym.tasks import named_task

DISPLACEMENT = "pma_gym/IsokineticDisplacement-v0"
MADE = {"model": "serres2008", "pressure_kpa": 300.0}
HORIZONS = {"displacement": 501, "rotation": 1501, "isotonic": 751, "isokinetic_exercise": 1501}


def run(env) -> tuple[int, bool, bool, dict]:
    """Steps of an episode without a command, how it ended, and its last info."""
    env.reset(seed=1)
    action = np.full(env.action_space.shape, -1.0, np.float32)
    for steps in range(1, 100_000):
        *_, terminated, truncated, info = env.step(action)
        if terminated or truncated:
            return steps, terminated, truncated, info
    raise AssertionError("the episode never ended")


# -- specs -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_registered_specs_have_the_steps_of_the_default_options(name):
    assert gym.spec(name).max_episode_steps == HORIZONS[ENVIRONMENTS[name]]
    env = gym.make(name)
    assert env.spec.max_episode_steps == env.unwrapped.horizon == HORIZONS[ENVIRONMENTS[name]]


@pytest.mark.parametrize("options", [
    {"control_rate_hz": 10.0, "max_episode_steps": 10**9},
    {"task": "triangle_high"},
    {"task": "displacement_steps_3"},
])  # fmt: skip
def test_the_spec_has_the_true_steps_and_no_episode_is_cut(options):
    env = gym.make(DISPLACEMENT, **options)
    true = named_task(options.get("task", "displacement")).steps(
        float(options.get("control_rate_hz", 100.0))
    )
    assert type(env) is PMAEnv and env.spec.max_episode_steps == true
    steps, terminated, truncated, info = run(env)
    assert (steps, terminated, truncated) == (true, False, True)
    assert info["limit_code"] == 0 and info["time_s"] >= env.unwrapped.task.duration - 1e-9


def remade(spec: EnvSpec, how: str) -> EnvSpec:
    return EnvSpec.from_json(spec.to_json()) if how == "json" else spec


@pytest.mark.parametrize("how", ["memory", "json"])
@pytest.mark.parametrize("first", [{}, {"max_episode_steps": 7}])
@pytest.mark.parametrize(
    ("then", "wanted"), [({}, None), ({"max_episode_steps": 9}, 9), ({"max_episode_steps": -1}, 0)]
)
def test_environments_are_made_anew_from_their_specs(how, first, then, wanted):
    env = gym.make(DISPLACEMENT, **({"control_rate_hz": 10.0} | MADE | first))
    whole = named_task("displacement").steps(env.unwrapped.options.control_rate_hz)
    if wanted is None:
        wanted = first.get("max_episode_steps", whole)
    for spec in (env.spec, RecordEpisodeStatistics(env).spec):
        again = gym.make(remade(spec, how), **then)
        steps, _, truncated, info = run(again)
        assert truncated and steps == (wanted or whole) == again.spec.max_episode_steps
        assert info["rmse_mm"] > 0.0 and info["limit_code"] == 0


@pytest.mark.parametrize("how", ["memory", "json"])
def test_other_options_of_a_remade_spec_have_their_own_steps(how):
    for spec in (gym.spec(DISPLACEMENT), gym.make(DISPLACEMENT, control_rate_hz=10).spec):
        env = gym.make(remade(spec, how), control_rate_hz=200.0)
        assert run(env)[0] == 1002 == env.spec.max_episode_steps
    limited = gym.make(DISPLACEMENT, max_episode_steps=7).spec
    assert run(gym.make(remade(limited, how), control_rate_hz=200.0))[0] == 7


def test_a_number_that_is_asked_for_counts_though_it_is_the_registered_one():
    env = gym.make(DISPLACEMENT, control_rate_hz=200.0, max_episode_steps=501)
    assert run(env)[0] == 501 == env.spec.max_episode_steps


def test_wrappers_find_what_they_look_for():
    assert TimeAwareObservation(gym.make(DISPLACEMENT)).max_timesteps == 501
    assert TimeAwareObservation(gym.make(DISPLACEMENT, control_rate_hz=10)).max_timesteps == 51
    for options in ({}, {"max_episode_steps": 5}, {"disable_env_checker": False}):
        env = gym.make(DISPLACEMENT, **(MADE | options))
        assert env.spec.max_episode_steps == options.get("max_episode_steps", 501)
        env.spec.make(render_mode="rgb_array").reset(seed=1)


# -- the last info ---------------------------------------------------------------------------------


def keys_at_the_end() -> set[str]:
    return set(run(PMAEnv("displacement", control_rate_hz=20.0, **MADE))[3])


@pytest.mark.parametrize("make", [
    lambda: gym.make(DISPLACEMENT, max_episode_steps=6, disable_env_checker=False, **MADE),
    lambda: PMAEnv("displacement", max_episode_steps=6, **MADE),
    lambda: TimeLimit(PMAEnv("displacement", max_episode_steps=6, **MADE), 6),
])  # fmt: skip
def test_a_shortened_episode_has_its_summary_in_the_last_info(make):
    env = make()
    steps, terminated, truncated, info = run(env)
    assert (steps, terminated, truncated) == (6, False, True)
    assert set(info) == keys_at_the_end()
    for name in ("rmse_mm", "percent_of_range"):
        assert info[name] == env.unwrapped.episode_summary()[name]
    # The whole episode's first steps are these.
    whole = PMAEnv("displacement", **MADE)
    whole.reset(seed=1)
    for _ in range(6):
        whole.step(np.full(1, -1.0))
    assert whole.episode_summary() == env.unwrapped.episode_summary()
    # It begins anew, and ends there again.
    assert run(env)[0] == 6


def test_what_an_episode_did_not_reach_counts_until_its_truncation(fragile, follow):
    made = {"model": fragile, "pressure_kpa": 300, "control_rate_hz": 10.0}
    rewards = []
    for steps in (None, 40):
        env = PMAEnv("displacement", max_episode_steps=steps, **made)
        env.reset(seed=0)
        terminated = truncated = False
        while not (terminated or truncated):
            _, reward, terminated, truncated, info = env.step(env.action(env.time * 2.0))
        assert terminated and env.ended_by == "cable tension above 450 N"
        assert env.horizon == (steps or 51)
        rewards.append(reward)
    assert rewards[1] - rewards[0] == pytest.approx(100.0 * (51 - 40))


# -- batches ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("mode", "options", "steps"),
    [("sync", {"max_episode_steps": 6}, 6), ("async", {"control_rate_hz": 10.0}, 51)],
)
def test_every_kind_of_vector_has_the_true_steps_and_the_summary(mode, options, steps):
    envs = gym.make_vec(DISPLACEMENT, 2, vectorization_mode=mode, **MADE, **options)
    envs.reset(seed=1)
    actions, count, truncated = np.full((2, 1), -1.0, np.float32), 0, np.zeros(2, bool)
    while not truncated.any():
        *_, truncated, info = envs.step(actions)
        count += 1
    assert count == steps and (info["rmse_mm"] > 0.0).all()
    envs.close()


@pytest.mark.parametrize("how", ["memory", "json"])
def test_batches_are_made_anew_from_their_specs(how):
    for options, steps in (
        ({}, 501),
        ({"max_episode_steps": 6}, 6),
        ({"control_rate_hz": 10}, 51),
    ):
        envs = gym.make_vec(DISPLACEMENT, 2, **options)
        again = gym.make_vec(remade(envs.spec, how))
        assert again.spec.max_episode_steps == again.engine.horizon == steps
    assert gym.make_vec(gym.make(DISPLACEMENT).spec, 2).spec.max_episode_steps == 501


def test_an_own_id_cuts_single_environments_and_batches_alike():
    name = "Short-v0"
    gym.register(
        name, entry_point="pma_gym:PMAEnv", vector_entry_point="pma_gym.envs:PMAVectorEnv",
        max_episode_steps=5,
    )  # fmt: skip
    try:
        single, envs = gym.make(name), gym.make_vec(name, 2)
        assert run(single)[0] == 5 == single.spec.max_episode_steps == envs.spec.max_episode_steps
        envs.reset(seed=1)
        ends = [envs.step(np.zeros((2, 1)))[3].all() for _ in range(5)]
        assert ends == [False] * 4 + [True]
    finally:
        del gym.registry[name]
