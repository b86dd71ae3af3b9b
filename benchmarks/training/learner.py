"""Stable-Baselines3's algorithms, made from a preset."""

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.noise import NormalActionNoise, VectorizedActionNoise
from stable_baselines3.common.vec_env import VecEnv

from benchmarks.training.configuration.preset import Preset, PresetError
from benchmarks.training.configuration.zoo_text import ACTIVATIONS

_ACTIVATIONS = {name: getattr(torch.nn, name.removeprefix("nn.")) for name in ACTIVATIONS}


def learner(preset: Preset, envs: VecEnv, seed: int, device: str = "cpu") -> BaseAlgorithm:
    """A model that has learned nothing yet.

    Raises:
        PresetError: a device that is absent, or sb3-contrib missing.
    """
    check_device(device)
    made: list[BaseAlgorithm] = []

    def remaining() -> float:
        done = made[0].num_timesteps if made else 0
        return max(0.0, 1.0 - done / preset.steps)

    settings = {key: _value(value, remaining) for key, value in preset.settings.items()}
    if preset.noise_std:
        noise = NormalActionNoise(np.zeros(1), np.full(1, preset.noise_std))
        settings["action_noise"] = VectorizedActionNoise(noise, envs.num_envs)
    if preset.algorithm != "ppo" and "train_freq" in settings:
        settings["train_freq"] = int(settings["train_freq"])
    policy: Any = dict(preset.network)
    if "activation_fn" in policy:
        policy["activation_fn"] = _ACTIVATIONS[policy["activation_fn"]]
    make = _classes()[preset.algorithm]
    model = make("MlpPolicy", envs, policy_kwargs=policy, seed=seed, device=device, **settings)
    made.append(model)
    return model


def _classes() -> dict[str, Callable[..., BaseAlgorithm]]:
    try:
        from sb3_contrib import TQC
    except ImportError:
        return {"ppo": PPO, "sac": SAC, "td3": TD3}
    return {"ppo": PPO, "sac": SAC, "td3": TD3, "tqc": TQC}


def check_device(device: str) -> None:
    """Refuse a device that this machine has not.

    Raises:
        PresetError: names it and the fix.
    """
    try:
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError) as error:
        why = str(error).splitlines()[0]
        raise PresetError(
            f"device {device!r} cannot be used: {why}; leave --device out for the processor"
        ) from error


def _value(given: Any, remaining: Callable[[], float]) -> Any:  # noqa: ANN401
    """A setting's value; "lin_x" falls linearly from x to 0 over the whole training.

    Stable-Baselines3 would let it fall over every call of `learn`, of which a training has several.
    """
    if isinstance(given, str) and given.startswith("lin_"):
        first = float(given.removeprefix("lin_"))
        return lambda _: first * remaining()
    return given
