"""`train --seeds --executor`: a folder and a policy for each seed."""

import io
from dataclasses import replace

import pytest

pytest.importorskip("stable_baselines3")
pytest.importorskip("sb3_contrib")
pytest.importorskip("safetensors")

from rich.console import Console
from safetensors.numpy import load_file
from typer.testing import CliRunner

from benchmarks.__main__ import app
from benchmarks.executors.executor import ThisProcess
from benchmarks.executors.local import LocalProcesses
from benchmarks.training import train_policies
from benchmarks.training.run import Order


def weights(path):
    return {
        name: array.tobytes() for name, array in load_file(path.with_suffix(".safetensors")).items()
    }


def test_every_seed_has_its_folder_and_its_policy(preset, tmp_path):
    order, console = Order(preset("ppo", n_timesteps=128), seed=3), Console(file=io.StringIO(), width=500)
    trainings = [(replace(order, seed=seed), tmp_path / f"seed-{seed}") for seed in (3, 4)]
    third, fourth = train_policies.run_seeds(trainings, ThisProcess(), console)
    assert third.parent.name == "seed-3" and fourth.parent.name == "seed-4"
    assert weights(fourth) != weights(third)
    assert "Seed 4: " in console.file.getvalue() and str(fourth) in console.file.getvalue()


def test_the_command_gives_every_seed_a_folder_and_the_executor_its_processes(
    tmp_path, monkeypatch
):
    asked = []
    monkeypatch.setattr(
        train_policies, "run_seeds", lambda trainings, places, _: asked.append((trainings, places))
    )
    words = [
        "train",
        "--algo",
        "ppo",
        "--task",
        "rotation",
        "--seeds",
        "3",
        "--seed",
        "5",
        "--jobs",
        "2",
        "--executor",
        "local",
    ]
    done = CliRunner().invoke(app, [*words, "--out", str(tmp_path)])
    assert done.exit_code == 0, done.stderr
    ((trainings, places),) = asked
    assert [order.seed for order, _ in trainings] == [5, 6, 7]
    assert [folder.name for _, folder in trainings] == ["seed-5", "seed-6", "seed-7"]
    assert isinstance(places, LocalProcesses) and places.jobs == 2
