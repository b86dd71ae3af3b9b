"""The batch that Stable-Baselines3 trains on is its own loop over single environments."""

import warnings

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from stable_baselines3 import PPO, SAC
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import (
    DummyVecEnv,
    VecFrameStack,
    VecMonitor,
    VecNormalize,
)

from pma_gym.envs import PMAEnv
from pma_gym.envs.sb3 import SB3VecEnv

MADE = {"model": "serres2008", "pressure_kpa": 300, "control_rate_hz": 10.0}


@pytest.mark.parametrize("count", [1, 2, 17])
@pytest.mark.parametrize("task", ["displacement", "rotation"])
def test_a_batch_is_stable_baselines_own_loop(fragile, task, count):
    made = MADE | {"model": fragile, "pressure_kpa": "random", "randomisation": "varied"}
    ours = SB3VecEnv(count, task, **made)
    theirs = DummyVecEnv([lambda: Monitor(PMAEnv(task, **made))] * count)
    for one in (ours, theirs):
        one.seed(7)
    generator, ends = np.random.default_rng(1), np.zeros(2, int)
    np.testing.assert_array_equal(ours.reset(), theirs.reset())
    for k in range(330):
        high = 1.0 if k % 250 < 60 else -0.9
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
            assert info == other
    assert ends[0] > 0
    if task == "displacement":
        assert ends[1] > 0


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
    envs = SB3VecEnv(3, **(MADE | {"noise": False}))

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


def test_attributes_and_methods():
    envs = SB3VecEnv(3, **MADE)
    assert envs.get_attr("task") == [envs.envs.task] * 3
    assert envs.get_attr("render_mode", indices=1) == [None]
    assert envs.has_attr("station_info") and not envs.has_attr("nothing")
    with pytest.raises(AttributeError, match="nothing"):
        envs.get_attr("nothing")
    with pytest.raises(AttributeError, match="make the environments anew"):
        envs.set_attr("task", 3)
    envs.reset()
    (info,) = envs.env_method("station_info", indices=[2])
    assert info["pressure_kpa"] == pytest.approx([300.0] * 3)
    assert envs.env_is_wrapped(Monitor) == [False] * 3
    with pytest.raises(TypeError, match="unknown option 'autoreset_mode'"):
        SB3VecEnv(3, autoreset_mode="NextStep")
    with pytest.warns(UserWarning, match="no `render_mode`"):
        assert envs.render() is None
    envs.close()


def test_wrappers_of_stable_baselines(tmp_path):
    log = tmp_path / "monitor.csv"
    inner = VecMonitor(SB3VecEnv(5, **MADE), str(log), info_keywords=("rmse_mm", "ended_by"))
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
    envs = SB3VecEnv(16, reward="gaussian", **MADE)
    agent = PPO("MlpPolicy", envs, n_steps=64, batch_size=256, n_epochs=2, seed=0, device="cpu")
    agent.learn(3000)
    # 192 steps; some may have broken a limit on the way.
    assert 48 <= len(agent.ep_info_buffer or ()) < 100
    assert all(0 < episode["l"] <= 51 for episode in agent.ep_info_buffer or ())
    again = SB3VecEnv(16, reward="gaussian", **MADE)
    twin = PPO("MlpPolicy", again, n_steps=64, batch_size=256, n_epochs=2, seed=0, device="cpu")
    twin.learn(3000)
    observations = envs.reset()
    np.testing.assert_array_equal(
        agent.predict(observations, deterministic=True)[0],
        twin.predict(observations, deterministic=True)[0],
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mean, _ = evaluate_policy(agent, VecMonitor(envs), n_eval_episodes=16)
    assert 0.0 < mean < 51.0


def test_sac_fills_its_buffer_from_a_batch():
    envs = SB3VecEnv(4, **MADE)
    agent = SAC(
        "MlpPolicy", envs, learning_starts=200, batch_size=64, buffer_size=2000, seed=0,
        device="cpu",
    )  # fmt: skip
    agent.learn(500)
    buffer = agent.replay_buffer
    assert buffer is not None
    assert buffer.timeouts[:125].sum() == 8 and np.all(buffer.dones[50] == 1.0)
