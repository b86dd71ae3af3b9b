"""The batch that Stable-Baselines3 trains on is its own loop over single environments.

Stable-Baselines3's checker finds nothing to say.

Stable-Baselines3's SubprocVecEnv hands environments and what they hold over from its workers.
"""

import pickle

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from gymnasium.wrappers import TimeLimit
from stable_baselines3 import PPO
from stable_baselines3.common.env_checker import check_env
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import (
    DummyVecEnv,
    SubprocVecEnv,
    VecFrameStack,
    VecMonitor,
    VecNormalize,
)

from pma_gym.envs import ENVIRONMENTS, PMAEnv
from pma_gym.plant.plant import Plant
from pma_gym.sb3 import SB3VecEnv

MADE = {"model": "serres2008", "pressure_kpa": 300, "control_rate_hz": 10.0}


@pytest.mark.parametrize("count", [1, 3])
def test_a_batch_is_stable_baselines_own_loop(fragile, count):
    task, made = "displacement", MADE | {"model": fragile, "randomisation": "varied"}
    ours = SB3VecEnv(count, task, **made)
    theirs = DummyVecEnv([lambda: Monitor(PMAEnv(task, **made))] * count)
    for one in (ours, theirs):
        one.seed(7)
    generator, ends = np.random.default_rng(1), np.zeros(2, int)
    np.testing.assert_array_equal(ours.reset(), theirs.reset())
    for k in range(180):
        high = 1.0 if k < 60 else -0.9
        actions = generator.uniform(-1.0, high, (count, 1)).astype(np.float32)
        *results, infos = ours.step(actions)
        *expected, their_infos = theirs.step(actions)
        for mine, its in zip(results, expected, strict=True):
            np.testing.assert_array_equal(mine, its)
            assert mine.dtype == its.dtype
        for info, other, over in zip(infos, their_infos, results[2], strict=True):
            if not over:
                assert info == {} and not other["TimeLimit.truncated"]
                continue
            ends[int(info["TimeLimit.truncated"])] += 1
            np.testing.assert_array_equal(
                info.pop("terminal_observation"), other.pop("terminal_observation")
            )
            episode, its = info.pop("episode"), other.pop("episode")
            assert set(episode) == set(its) and episode["l"] == its["l"]
            assert episode["r"] == pytest.approx(its["r"], abs=1e-5)
            np.testing.assert_equal(info, other)
    assert np.all(ends > 0)


def test_references_are_drawn_for_every_episode():
    made = MADE | {"task": "displacement_steps", "reference": "random", "max_episode_steps": 3}
    check_env(PMAEnv(**made))
    envs, names = SB3VecEnv(3, **made), []
    envs.seed(1)
    envs.reset()
    for _ in range(2):
        names += [task.name for task in envs.get_attr("task")]
        *_, over, _ = [envs.step(np.zeros((3, 1))) for _ in range(3)][-1]
        assert over.all()
    assert len(set(names)) == 6


def test_seeds_count_for_one_reset():
    envs = SB3VecEnv(3, **MADE)
    assert envs.seed(5) == [5, 6, 7]
    first = envs.reset()
    second = envs.reset()
    envs.seed(5)
    np.testing.assert_array_equal(envs.reset(), first)
    assert np.any(second != first)
    np.testing.assert_array_equal(envs.reset(), second)


def test_options_count_for_one_reset():
    envs = SB3VecEnv(3, **MADE)

    def pressures() -> np.ndarray:
        envs.reset()
        return envs.envs.station_info()["pressure_kpa"]

    envs.set_options({"pressure_kpa": 400})
    assert pressures() == pytest.approx([400.0] * 3)
    assert pressures() == pytest.approx([300.0] * 3)
    envs.set_options([{"pressure_kpa": 200}, {}, {"pressure_kpa": 500}])
    assert pressures() == pytest.approx([200.0, 300.0, 500.0])
    envs.set_options({"presure_kpa": 400})
    with pytest.raises(TypeError, match="did you mean 'pressure_kpa'"):
        envs.reset()


def test_infos_that_were_written_to_are_not_given_again():
    envs = SB3VecEnv(4, **MADE)
    envs.reset()
    actions = np.full((4, 1), -0.9, np.float32)
    infos = envs.step(actions)[3]
    infos[1]["mine"] = 1
    infos[2] = {"other": 2}
    kept = infos[1]
    assert envs.step(actions)[3] == [{}] * 4
    assert kept == {"mine": 1} and infos[2] == {"other": 2}
    for _ in range(49):
        infos = envs.step(actions)[3]
    assert all("episode" in info for info in infos)
    assert envs.step(actions)[3] == [{}] * 4


def test_attributes_are_those_of_each_environment():
    envs = SB3VecEnv(3, pressures_kpa=[200, 300, 400], control_rate_hz=10.0, model="serres2008")
    envs.reset()
    assert envs.get_attr("task") == [envs.envs.task] * 3
    assert envs.get_attr("pressure") == pytest.approx([2e5, 3e5, 4e5])
    assert envs.get_attr("pressure", indices=[2, 0]) == pytest.approx([4e5, 2e5])
    assert envs.get_attr("pressure", indices=-1) == pytest.approx([4e5])
    assert envs.get_attr("pressure", indices=np.int64(1)) == pytest.approx([3e5])
    assert envs.get_attr("observation_space") == [envs.observation_space] * 3
    assert envs.get_attr("action_space") == [envs.action_space] * 3
    assert envs.get_attr("render_mode", indices=1) == [None]
    assert envs.has_attr("station_info") and not envs.has_attr("nothing")
    for error, message, act in (
        (AttributeError, "nothing", lambda: envs.get_attr("nothing")),
        (
            AttributeError,
            r"only the whole batch has.*\.envs\.num_envs",
            lambda: envs.get_attr("num_envs"),
        ),
        (
            IndexError,
            "no environment 3 in a batch of 3: numbers go from -3 to",
            lambda: envs.get_attr("task", indices=[0, 3]),
        ),
    ):
        with pytest.raises(error, match=message):
            act()


@pytest.mark.parametrize("name", ["pressure", "options", "mine"])
def test_attributes_cannot_be_set_and_the_message_says_what_to_do(name):
    envs = SB3VecEnv(2, **MADE)
    for change in (
        lambda: envs.set_attr(name, 3),
        lambda: envs.set_attr(name, 3, indices=[1]),
        lambda: envs.env_method("set_wrapper_attr", name, 3),
        lambda: setattr(envs.get_attr("unwrapped")[0], name, 3),
    ):
        with pytest.raises(AttributeError, match=rf"'{name}' cannot be set.*set_options\(\)"):
            change()
    assert not envs.has_attr("mine")


def test_pressures_of_later_episodes_can_be_set_with_the_checks_of_the_option():
    envs = SB3VecEnv(3, **MADE | {"max_episode_steps": 2})
    with pytest.raises(ValueError, match=r"pressure_kpa must be a number in 150-575 kPa.*got 900"):
        envs.set_attr("pressure_kpa", 900)
    before = envs.get_attr("pressure_kpa")
    envs.reset()
    envs.set_attr("pressure_kpa", np.float64(450.0), indices=[1])
    envs.set_attr("pressure_kpa", [200, 210], indices=2)
    assert envs.get_attr("pressure_kpa") == [before[0], 450.0, [200.0, 210.0]]
    for _ in range(2):
        envs.step(np.full((3, 1), -1.0, np.float32))
    # The episodes that began by themselves have them.
    assert envs.get_attr("time") == [0.0] * 3
    assert envs.get_attr("pressure")[1] == 450e3
    assert envs.get_attr("pressure")[2] in (200e3, 210e3)


def test_methods_act_on_the_environments_that_are_asked_for():
    envs = SB3VecEnv(3, **MADE)
    envs.seed(5)
    envs.reset()
    for _ in range(20):
        envs.step(np.full((3, 1), -0.5, np.float32))
    assert [one["time_s"] for one in envs.env_method("station_info", indices=[2])] == [2.0]
    single = PMAEnv(**MADE)
    results = envs.env_method("reset", indices=[1], seed=9, options={"pressure_kpa": 450})
    assert envs.get_attr("time") == [2.0, 0.0, 2.0]
    expected = single.reset(seed=9, options={"pressure_kpa": 450})
    np.testing.assert_array_equal(results[0][0], expected[0])
    assert len(results) == 1 and results[0][1] == expected[1]
    ends = {}
    for k in range(51):
        *_, dones, infos = envs.step(np.full((3, 1), -0.5, np.float32))
        ends |= {i: (k, infos[i]["episode"]["l"]) for i in np.flatnonzero(dones).tolist()}
    assert ends == {0: (30, 51), 1: (50, 51), 2: (30, 51)}
    actions = envs.env_method("action", 5.0)
    assert [action.tolist() for action in actions] == [[0.0]] * 3
    with pytest.raises(RuntimeError, match="step together|call step"):
        envs.env_method("step", np.zeros(1), indices=[1])
    with pytest.raises(TypeError, match="did you mean 'pressure_kpa'"):
        envs.env_method("reset", options={"presure_kpa": 300})


def test_rewards_are_evaluated_before_a_wrapper_normalises_them():
    envs = SB3VecEnv(4, **MADE)
    assert envs.env_is_wrapped(Monitor) == [True] * 4
    assert envs.env_is_wrapped(Monitor, indices=[1, 2]) == [True] * 2
    assert envs.env_is_wrapped(TimeLimit) == [False] * 4
    returns = []
    for batch in (SB3VecEnv(4, **MADE), DummyVecEnv([lambda: Monitor(PMAEnv(**MADE))] * 4)):
        wrapped = VecNormalize(batch)
        agent = PPO("MlpPolicy", wrapped, n_steps=64, seed=3, device="cpu")
        wrapped.seed(5)
        # Statistics of observations go on in an evaluation: the two need the same beginnings.
        returns.append(evaluate_policy(agent, wrapped, 4, return_episode_rewards=True)[0])
    np.testing.assert_allclose(returns[0], returns[1], rtol=1e-6)
    assert np.mean(returns[0]) < -100.0


def test_a_registered_id_is_accepted():
    envs = SB3VecEnv(2, "pma_gym:pma_gym/IsokineticRotation-v0", **MADE)
    assert envs.envs.task.name == "rotation" and envs.observation_space.shape == (7,)
    assert envs.get_attr("spec")[1].id == "pma_gym/IsokineticRotation-v0"


def test_an_id_of_ones_own_brings_its_options(monkeypatch):
    monkeypatch.setattr(gym.envs.registration, "registry", dict(gym.registry))
    monkeypatch.setattr(gym, "registry", gym.envs.registration.registry)
    gym.register("Mine-v0", "pma_gym.envs:PMAEnv", kwargs={"task": "rotation", **MADE})
    envs = SB3VecEnv(2, "Mine-v0", pressure_kpa=400)
    assert (envs.envs.task.name, envs.envs.options.pressure_kpa) == ("rotation", 400)
    assert envs.envs.options.control_rate_hz == 10.0
    with pytest.raises(
        ValueError, match="CartPole-v1 is not an environment of pma_gym.*make_vec_env"
    ):
        SB3VecEnv(2, "CartPole-v1")
    with pytest.raises(gym.error.NameNotFound, match="Did you mean: `IsokineticRotation`"):
        SB3VecEnv(2, "pma_gym/IsokineticRotatoin-v0")


def test_options_of_the_batch_are_checked():
    with pytest.raises(TypeError, match="unknown option 'autoreset_mode'"):
        SB3VecEnv(3, autoreset_mode="NextStep")
    envs = SB3VecEnv(3, **MADE)
    with pytest.warns(UserWarning, match="no `render_mode`"):
        assert envs.render() is None
    envs.close()


def test_wrappers_of_stable_baselines(tmp_path):
    log = tmp_path / "monitor.csv"
    # Stable-Baselines3 says that the file's numbers are VecMonitor's; they are the same.
    with pytest.warns(UserWarning, match="already wrapped with a `Monitor`"):
        inner = VecMonitor(SB3VecEnv(5, **MADE), str(log), info_keywords=("rmse_mm", "limit_code"))
    envs = VecFrameStack(VecNormalize(inner), 2)
    assert envs.reset().shape == (5, 14)
    episodes = 0
    for _ in range(120):
        observations, rewards, dones, infos = envs.step(np.full((5, 1), -0.8, np.float32))
        assert np.isfinite(observations).all() and np.isfinite(rewards).all()
        for done, info in zip(dones, infos, strict=True):
            assert done == ("episode" in info)
            if done:
                assert info["episode"]["l"] == 51 and info["episode"]["rmse_mm"] > 0.0
                assert info["terminal_observation"].shape == (14,)
                episodes += 1
    assert episodes == 10
    envs.close()
    assert len(log.read_text().splitlines()) == 12


def test_ppo_learns_from_a_batch():
    envs = SB3VecEnv(16, **MADE)
    agent = PPO("MlpPolicy", envs, n_steps=64, batch_size=256, n_epochs=2, seed=0, device="cpu")
    agent.learn(1000)
    # 64 steps of each; some may have broken a limit on the way.
    assert 16 <= len(agent.ep_info_buffer or ()) < 100
    assert all(0 < episode["l"] <= 51 for episode in agent.ep_info_buffer or ())
    again = SB3VecEnv(16, **MADE)
    twin = PPO("MlpPolicy", again, n_steps=64, batch_size=256, n_epochs=2, seed=0, device="cpu")
    twin.learn(1000)
    observations = envs.reset()
    np.testing.assert_array_equal(
        agent.predict(observations, deterministic=True)[0],
        twin.predict(observations, deterministic=True)[0],
    )


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_check_env_finds_nothing_to_say(name):
    # pytest turns each warning into an error.
    check_env(gym.make(name, render_mode="rgb_array"), warn=True)


def test_get_attr_of_what_a_fresh_worker_holds():
    options = {"model": "serres2008", "randomisation": "varied", "control_rate_hz": 10.0}
    # The worker has not imported pma_gym before it makes the environment.
    envs = make_vec_env(
        f"pma_gym:{next(iter(ENVIRONMENTS))}",
        1,
        env_kwargs=options,
        vec_env_cls=SubprocVecEnv,
        vec_env_kwargs={"start_method": "spawn"},
        monitor_kwargs={"info_keywords": ("rmse_mm",)},
    )
    try:
        envs.seed(3)
        np.testing.assert_array_equal(envs.reset()[0], PMAEnv(**options).reset(seed=3)[0])
        envs.step(np.full((1, 1), 0.2, np.float32))
        copies = envs.get_attr("unwrapped")
        plants = envs.get_attr("plant")
        assert [type(env) for env in copies] == [PMAEnv]
        assert all(isinstance(plant, Plant) for plant in plants)
        assert [env.plant.model for env in copies] == [plant.model for plant in plants]
        assert [env.station for env in copies] == envs.get_attr("station")
        for name in ("measurement", "task", "options", "table", "condition", "nominal_plant"):
            assert len(envs.get_attr(name)) == 1
        # The copies go on as those in the workers do.
        action = np.full((1, 1), -0.3, np.float32)
        observations, rewards, *_ = envs.step(action)
        for i, env in enumerate(copies):
            observation, reward, *_ = env.step(action[i])
            np.testing.assert_array_equal(observation, observations[i])
            assert reward == rewards[i]
        # States go there and come back.
        state = copies[0].get_state()
        envs.step(action)
        envs.env_method("set_state", state)
        assert envs.env_method("get_state") == [state]
        for _ in range(49):
            _, _, over, infos = envs.step(np.full((1, 1), -1.0, np.float32))
        assert over.all() and infos[0]["episode"]["rmse_mm"] > 0.0
    finally:
        envs.close()


def test_copies_of_a_vec_env_go_on_with_the_same_bits():
    envs = SB3VecEnv(3, "displacement", model="serres2008", control_rate_hz=10.0)
    envs.seed(1)
    envs.reset()
    actions = np.random.default_rng(1).uniform(-1.0, 0.0, (70, 3, 1))
    for action in actions[:45]:
        envs.step(action)
    other = pickle.loads(pickle.dumps(envs))
    for action in actions[45:]:
        seen, its = envs.step(action), other.step(action)
        for one, two in zip(seen[:3], its[:3], strict=True):
            np.testing.assert_array_equal(one, two)
        returns = [[info.get("episode", {}).get(key) for info in seen[3]] for key in "rl"]
        assert returns == [[info.get("episode", {}).get(key) for info in its[3]] for key in "rl"]
