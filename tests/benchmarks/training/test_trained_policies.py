"""Policies that were trained: contenders of the suites, their cards, what ships."""

from dataclasses import replace

import pytest
from typer.testing import CliRunner

from benchmarks.__main__ import app
from benchmarks.runner.controller_spec import ControllerError, parse_controllers
from benchmarks.suites.frozen import frozen_suite
from benchmarks.training import train_policies
from benchmarks.training.preset import load_preset
from benchmarks.training.train_policies import save_policy, train_words
from controllers.policies.policy_file import load_policy_file, save_policy_file
from controllers.policy import shipped_policies
from pma_gym.envs import PMAEnv
from tests.controllers.policies.test_network import drawn_policy


@pytest.fixture(scope="module")
def station():
    environment = PMAEnv("displacement", pressure_kpa=300.0)
    environment.reset(seed=0)
    return environment.station


def trained(station):
    policy = drawn_policy(station)
    scores = {"error": 0.03, "mean": 0.04, "unit": "mm", "broken": 0, "reward": -1.0}
    training = {"preset": "increment", "seed": 2, "scores": {"validation": scores}}
    return replace(policy, training=dict(policy.training) | training)


def test_a_policy_is_saved_with_its_card_and_ships_if_asked(station, tmp_path, monkeypatch):
    monkeypatch.setattr(train_policies, "POLICIES", tmp_path / "shipped")
    (tmp_path / "shipped").mkdir()
    policy = trained(station)
    path = save_policy(policy, tmp_path)
    words = path.with_suffix(".md").read_text(encoding="utf-8")
    assert "mean 0.04 mm, interquartile mean 0.03 mm" in words
    assert f"`python {' '.join(train_words(policy))}`" in words and "--seed 2" in words
    assert not shipped_policies(tmp_path / "shipped")
    save_policy(policy, tmp_path, ship=True)
    (shipped,) = shipped_policies(tmp_path / "shipped")
    assert load_policy_file(shipped).weights.sizes == policy.weights.sizes


def test_what_ships_is_trained_again_by_its_cards_command():
    for path in shipped_policies():
        policy = load_policy_file(path)
        assert f"`python {' '.join(train_words(policy))}`" in path.with_suffix(".md").read_text()
        assert f"# {policy.name}\n" in train_policies.card(policy)
        training = policy.training
        preset = load_preset(training["preset"], training["algorithm"], policy.environment["id"])
        adapter = preset.env.adapter
        assert (adapter.view, adapter.form) == (policy.view, policy.form)


def test_a_policy_file_and_a_folder_are_contenders(station, tmp_path):
    policy = trained(station)
    save_policy_file(policy, tmp_path / policy.name)
    file, folder = parse_controllers(f"{tmp_path / policy.name}.json,{tmp_path}:ppo")
    suite = frozen_suite("robust")
    for spec in (file, folder):
        assert spec.make().name
        only = suite.entry(spec).only
        assert "displacement" in only and not any("rotation" in task for task in only)
    with pytest.raises(ControllerError, match="has no policy of 'sac'; it has displacement-100hz"):
        parse_controllers(f"{tmp_path}:sac")


def test_a_contender_that_was_cut_off_is_refused(station, tmp_path):
    policy = trained(station)
    save_policy_file(policy, tmp_path / policy.name)
    weights = tmp_path / f"{policy.name}.safetensors"
    weights.write_bytes(weights.read_bytes()[:-100])
    with pytest.raises(ControllerError, match="was cut off, changed or mixed up"):
        parse_controllers(f"{tmp_path / policy.name}.json")


def test_what_ships_is_small():
    total = sum(
        p.stat().st_size for path in shipped_policies() for p in path.parent.glob(f"{path.stem}.*")
    )
    assert 0 < total < 1_000_000


def test_every_seed_has_its_folder_and_ships_alone(tmp_path, monkeypatch):
    pytest.importorskip("sb3_contrib")
    from benchmarks.training import train_policies

    asked = []
    monkeypatch.setattr(train_policies, "run_train", lambda *words: asked.append(words))
    words = ["train", "--algo", "ppo", "--task", "rotation", "--seeds", "3", "--seed", "5"]
    done = CliRunner().invoke(app, [*words, "--out", str(tmp_path)])
    assert done.exit_code == 0, done.stderr
    assert [order.seed for order, *_ in asked] == [5, 6, 7]
    assert [folder.name for _, folder, *_ in asked] == ["seed-5", "seed-6", "seed-7"]
    done = CliRunner().invoke(app, [*words, "--out", str(tmp_path), "--ship"])
    assert done.exit_code == 2 and "--ship takes one seed, got --seeds 3" in done.stderr
