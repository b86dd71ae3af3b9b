"""The study: seeds pooled, the best shipped, policies as contenders of the suites."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.report.errors import Errors, measures
from benchmarks.report.statistics import interquartile_mean
from benchmarks.runner.controller_spec import ControllerError, parse_controllers
from benchmarks.suites.frozen import frozen_suite
from benchmarks.suites.suite import Episode
from benchmarks.training.study.cells import CHANGES, cells
from benchmarks.training.study.figures import reached
from benchmarks.training.study.pooled import Pool
from benchmarks.training.study.ship import best_policies, card, ship
from controllers.policies.policy_file import load_policy_file, save_policy_file
from controllers.policy import shipped_policies
from pma_gym.envs import PMAEnv
from tests.controllers.drawn_policies import drawn_policy


@pytest.fixture(scope="module")
def station():
    environment = PMAEnv("displacement", pressure_kpa=300.0)
    environment.reset(seed=0)
    return environment.station


def trained(station, seed=0, error=0.03):
    policy = drawn_policy(station)
    scores = {"validation": {"error": error, "unit": "mm", "broken": 0, "reward": -1.0}}
    training = {"preset": "increment", "seed": seed, "scores": scores}
    return replace(policy, training=dict(policy.training) | training)


def pool(values):
    episodes = tuple(Episode(i, "displacement", 300.0, 0) for i in range(values.shape[1]))
    names = tuple(f"seed-{i}" for i in range(len(values)))
    return Pool(Errors(measures(["displacement"])[0], names, episodes, values))


def test_seeds_that_agree_give_the_mean_of_one():
    one = np.random.default_rng(0).uniform(0.02, 0.04, 64)
    pooled = pool(np.tile(one, (4, 1)))
    assert pooled.mean.estimate == pytest.approx(float(interquartile_mean(one)))
    assert pooled.mean.low < pooled.mean.estimate < pooled.mean.high
    assert pooled.by_seed.tolist() == pytest.approx([float(interquartile_mean(one))] * 4)


def test_seeds_that_differ_widen_the_interval():
    one = np.random.default_rng(0).uniform(0.02, 0.04, 64)
    same, spread = (
        pool(np.tile(one, (5, 1))),
        pool(one * np.array([0.6, 0.8, 1.0, 1.2, 1.4])[:, None]),
    )
    assert spread.mean.half_width > 2.0 * same.mean.half_width


def test_a_seed_counts_within_twice_the_best():
    pooled = pool(np.array([0.02, 0.04, 0.0401])[:, None] * np.ones((3, 8)))
    assert pooled.reliable == 2


def test_a_curve_is_below_an_error_when_it_first_is():
    curve = {"wall_s": [1.0, 2.0, 3.0], "error": [0.5, 0.03, 0.05]}
    assert reached(curve, 0.04) == 2.0
    assert reached(curve, 0.01) is None


def test_cells_are_told_apart_and_change_what_they_say():
    every = cells()
    assert len({(c.group, c.preset, c.task) for c in every}) == len(every)
    for cell in every:
        whole = cell._replace(change="").resolved
        assert (cell.resolved != whole) == bool(cell.change)
    assert set(CHANGES) == {c.change for c in every if c.change}


def test_the_seed_with_the_least_validation_error_ships(station, tmp_path):
    for seed, error in ((0, 0.03), (1, 0.02), (2, 0.04)):
        folder = tmp_path / "group" / f"seed-{seed}"
        folder.mkdir(parents=True)
        policy = trained(station, seed, error)
        save_policy_file(policy, folder / policy.name)
    (best,) = best_policies([tmp_path / "group"])
    assert best.parent.name == "seed-1"
    pooled = {"by_seed": [3.0, 2.0, 4.0], "mean": [3.0, 2.5, 3.5], "unit": "mm"}
    figures = {"seeds": 3, "judged": {"robust": {"displacement": pooled}}}
    (path,) = ship([tmp_path / "group"], {"group": figures}, tmp_path / "shipped")
    shipped = load_policy_file(path)
    assert shipped.training["seed"] == 1
    assert shipped.training["scores"]["suites"]["robust: displacement"]["this"] == 2.0
    words = path.with_suffix(".md").read_text(encoding="utf-8")
    assert "--task displacement --preset" in words and "--seed 1" in words
    assert "| robust: displacement | 2 mm | 3 [2.5, 3.5] |" in words
    assert card(shipped, 3) == words
    # What operators said of these weights stays with them, and goes with them.
    rows = [{"controller": "pid", "stations": "nominal", "rmse": [1.0], "ended": 0}]
    said = {"count": 8, "unit": "deg", "phases": ["I"], "rows": rows}
    scores = shipped.training["scores"]
    noted = dict(shipped.training) | {"scores": dict(scores) | {"operators": said}}
    noted["scores"]["validation"] = dict(scores["validation"]) | {"broken": 0}
    save_policy_file(replace(shipped, training=noted), path)
    (path,) = ship([tmp_path / "group"], {"group": figures}, tmp_path / "shipped")
    assert load_policy_file(path).training["scores"]["operators"] == said
    words = path.with_suffix(".md").read_text(encoding="utf-8")
    assert "8 random operators" in words and "| robust: displacement | 2 mm |" in words


def test_a_policy_that_loses_a_station_now_and_then_does_not_ship(station, tmp_path):
    for seed, (error, mean) in {0: (0.021, 0.03), 1: (0.02, 0.4), 2: (0.03, 0.05)}.items():
        policy = trained(station, seed, error)
        scores = {"validation": policy.training["scores"]["validation"] | {"mean": mean}}
        policy = replace(policy, training=dict(policy.training) | {"scores": scores})
        folder = tmp_path / f"seed-{seed}"
        folder.mkdir()
        save_policy_file(policy, folder / policy.name)
    (best,) = best_policies([tmp_path])
    assert best.parent.name == "seed-0"


def test_of_several_algorithms_the_best_ships_and_replaces_the_other(station, tmp_path):
    pooled = {"by_seed": [3.0], "mean": [3.0, 2.5, 3.5], "unit": "mm"}
    figures = {"seeds": 1, "judged": {"robust": {"displacement": pooled}}}
    groups = {"sac-residual": 0.02, "td3-residual": 0.03}
    for group, error in groups.items():
        folder = tmp_path / group / "seed-0"
        folder.mkdir(parents=True)
        name = f"displacement-100hz-{group.partition('-')[0]}"
        save_policy_file(replace(trained(station, 0, error), name=name), folder / name)
    shipped = tmp_path / "shipped"
    shipped.mkdir()
    save_policy_file(trained(station), shipped / "displacement-100hz-td3")
    save_policy_file(trained(station), shipped / "displacement-100hz-ppo")
    ship([tmp_path / group for group in groups], dict.fromkeys(groups, figures), shipped)
    assert {p.stem for p in shipped_policies(shipped)} == {
        "displacement-100hz-ppo",
        "displacement-100hz-sac",
    }


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
