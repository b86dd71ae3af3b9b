from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import pytest

pytest.importorskip("stable_baselines3")
pytest.importorskip("safetensors")

import torch

from benchmarks.training import policy_batch
from benchmarks.training.preset import Preset

SMALL = {
    "ppo": {"n_steps": 32, "batch_size": 32, "n_epochs": 2, "learning_rate": "lin_0.003"},
    "sac": {"learning_starts": 64, "buffer_size": 1200, "batch_size": 16, "ent_coef": "auto_0.01"},
    "td3": {"learning_starts": 64, "buffer_size": 1200, "batch_size": 16, "policy_delay": 2},
    "tqc": {"learning_starts": 64, "buffer_size": 1200, "batch_size": 16, "ent_coef": "auto_0.01"},
}
"""Settings of a training of no consequence."""

SLOW = {"control_rate_hz": 10.0, "pressure_kpa": 300.0}


@pytest.fixture(autouse=True)
def one_thread() -> Iterator[None]:
    """No test starts more threads than it says."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture
def preset(monkeypatch) -> Callable[..., Preset]:
    """A small preset on the nominal station, validated on two episodes."""
    monkeypatch.setattr(policy_batch, "VALIDATION", 1)

    def made(algorithm: str = "ppo", options: Mapping[str, Any] = SLOW, **fields: Any) -> Preset:
        wrapper = {
            "view": {"kind": "tracking", "preview": 2, "history": 2},
            "form": {"kind": "increment", "authority_v": 0.5},
            "options": options,
            "reward_scale": 0.1,
        }
        small = Preset(
            name="small",
            algorithm=algorithm,
            environment="pma_gym/IsokineticDisplacement-v0",
            wrapper=wrapper,
            n_envs=4,
            n_timesteps=512,
            average_share=0.5,
            noise_std=0.1 if algorithm == "td3" else 0.0,
            settings=SMALL[algorithm] | {"policy_kwargs": {"net_arch": [16]}},
        )
        return replace(small, **fields)

    return made
