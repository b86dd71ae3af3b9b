"""One piloted environment: it keeps the wrappers that it was given, as the zoo's Monitor."""

from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
pytest.importorskip("yaml")

import yaml
from stable_baselines3.common.monitor import Monitor

from benchmarks.training.configuration.preset import PRESETS, WRAPPER
from benchmarks.training.policy_env import PilotedEnv
from pma_gym import PMAEnv

DISPLACEMENT = "pma_gym/IsokineticDisplacement-v0"


def wrapped(env, preset):
    text = (Path(PRESETS) / preset / "ppo.yml").read_text(encoding="utf-8")
    (wrapper,) = yaml.safe_load(text)[DISPLACEMENT]["env_wrapper"]
    return PilotedEnv(env, **wrapper[WRAPPER])


# increment-late has options of its own: half the rate, so half the steps.
@pytest.mark.parametrize(("preset", "steps"), [("increment", 501), ("increment-late", 251)])
def test_wrappers_stay_around_the_environment_made_anew(preset, steps):
    monitored = wrapped(Monitor(gym.make(DISPLACEMENT)), preset)
    single = wrapped(PMAEnv("displacement"), preset)
    assert monitored.unwrapped is monitored.rig
    first, _ = monitored.reset(seed=3)
    assert np.array_equal(first, single.reset(seed=3)[0])
    rng, total, ended = np.random.default_rng(1), 0.0, False
    while not ended:
        action = rng.uniform(-1.0, 1.0, 1).astype(np.float32)
        seen, reward, terminated, truncated, info = monitored.step(action)
        same, *others = single.step(action)
        assert np.array_equal(seen, same) and others[:3] == [reward, terminated, truncated]
        total, ended = total + reward, terminated or truncated
    assert info["episode"]["l"] == steps
    # The wrapper inside sees the environment's own rewards, which are not bounded.
    assert info["episode"]["r"] < total
