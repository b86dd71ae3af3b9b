from collections.abc import Callable, Iterator
from typing import Any

import pytest

pytest.importorskip("stable_baselines3")
pytest.importorskip("safetensors")

import torch

from benchmarks.training import environments
from benchmarks.training.configuration.preset import Preset
from controllers.policies.adapter import ActionMapping
from controllers.policies.observation_spec import ObservationSpec

SMALL = {
    "ppo": {"n_steps": 32, "batch_size": 32, "n_epochs": 2, "learning_rate": "lin_0.003"},
    "sac": {"learning_starts": 64, "buffer_size": 1200, "batch_size": 16, "ent_coef": "auto_0.01"},
    "td3": {"learning_starts": 64, "buffer_size": 1200, "batch_size": 16, "policy_delay": 2},
    "tqc": {"learning_starts": 64, "buffer_size": 1200, "batch_size": 16, "ent_coef": "auto_0.01"},
}
"""Settings of a training of no consequence."""


@pytest.fixture(autouse=True)
def one_thread() -> Iterator[None]:
    """No test starts more threads than it says."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture
def preset(monkeypatch) -> Callable[..., Preset]:
    """A preset of two legs of a second each, on the nominal station, validated on two episodes."""
    monkeypatch.setattr(environments, "VALIDATION", 1)

    def made(algorithm: str = "ppo", **fields: Any) -> Preset:
        small = Preset(
            name="small",
            algorithm=algorithm,
            environment="pma_gym/IsokineticDisplacement-v0",
            view=ObservationSpec("tracking", 2, 2),
            form=ActionMapping("increment", 0.5),
            stations="",
            options={"control_rate_hz": 10.0, "pressure_kpa": 300.0},
            environments=4,
            steps=960,
            average_share=0.5,
            settings=SMALL[algorithm],
            network={"net_arch": [16]},
            noise_std=0.1 if algorithm == "td3" else 0.0,
        )
        return small.changed(**fields)

    return made
