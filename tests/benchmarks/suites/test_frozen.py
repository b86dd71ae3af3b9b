"""Frozen suites: no number moves without a new version; drawn stations can do what is asked."""

import hashlib
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.runner.case import Case, cases, run_case
from benchmarks.runner.controller_spec import ControllerSpec
from benchmarks.suites.frozen import frozen_suite, suite_names
from benchmarks.suites.stations import draw_station, inability
from benchmarks.suites.suite import NOMINAL, Episode, EpisodePlan, SuiteError
from controllers import CONTROLLERS
from pma_gym.envs import PMAEnv
from pma_gym.plant.model import dump_model, load_model

FROZEN = {
    "exercise": (2, "4e88e70f8d6b6c47"),
    "hard": (3, "1f3b7c3c6387bc97"),
    "many": (2, "b974962a2da6c913"),
    "nominal": (2, "3e4e11ff0657afc7"),
    "pressure": (2, "542aca9f3d87993f"),
    "reproduction": (2, "871047391c0cc318"),
    "robust": (2, "176552067d898220"),
}
"""Version and digest of every suite's numbers. Who changes a number gives it a new version."""

STATIONS = "fc2f0161ef521975"
"""Digest of the first drawn stations of `robust`, and so of `hard` and `pressure`."""

SPY = """
class Spy:
    name = "spy"
    def reset(self, reference, station):
        if station.model.name != "station" or "creep" in station.model.parameters:
            raise ValueError("it was told " + station.model.name)
    def act(self, observation, time):
        return 2.0
"""


def test_no_number_moves_without_a_new_version():
    assert set(suite_names()) == set(FROZEN)
    for name, (version, digest) in FROZEN.items():
        suite = frozen_suite(name)
        assert (suite.version, suite.digest) == (version, digest), (
            f"{name}.toml has other numbers than version {version} had; give it a new version"
        )


def test_many_draws_the_stations_of_robust_and_more():
    many, robust = frozen_suite("many"), frozen_suite("robust")
    assert many.recipe == robust.recipe and len(many.stations) > 30 * len(robust.stations)
    one = many.station(63).model
    assert dump_model(one) == dump_model(robust.station(63).model)
    assert [s.name for s in map(frozen_suite, suite_names()) if s.only_by_name] == [
        "many",
        "reproduction",
    ]


def acting(model):
    """The effects that are there; one at its neutral values has a shape that nothing sees."""
    for name, effect in model.effects.items():
        values = model.parameters[name]
        neutral = {
            stem: quantity.to_si(quantity.neutral)
            for stem, quantity in effect.quantities.items()
            if quantity.neutral is not None
        }
        if not neutral or any(getattr(values, stem) != zero for stem, zero in neutral.items()):
            # A parameter that the catalogue got later is as if it were not there.
            later = effect.defaults.items()
            parameters = model.values_in_files(name)
            yield name, dict(pair for pair in parameters.items() if pair not in later)


def test_no_drawn_station_moves_without_a_new_version():
    robust = frozen_suite("robust")
    texts = [repr(list(acting(robust.station(number).model))) for number in range(8)]
    assert hashlib.sha256("".join(texts).encode()).hexdigest()[:16] == STATIONS


@pytest.mark.parametrize("name", suite_names())
def test_every_case_is_there_once_and_every_trial_as_often_as_the_others(name):
    suite = frozen_suite(name)
    assert len(set(suite.episodes)) == len(suite.episodes)
    assert {entry.spec.name for entry in suite.entries} <= set(CONTROLLERS)
    controller = suite.entries[0].spec.name
    seeds = {suite.seed_of(episode, controller) for episode in suite.episodes}
    assert len(seeds) == len(suite.episodes)
    for task in suite.tasks:
        often = Counter(e.pressure_kpa for e in suite.episodes if e.task == task)
        assert max(often.values()) - min(often.values()) <= 1


def test_dealing_spreads_what_a_station_gets():
    plan = EpisodePlan(("rotation",), (275, 300, 350, 400, 450, 500, 550, 575), per_station=2)
    assert [pressure for _, pressure in plan.trials(0)] == [275, 450]
    dealt = Counter(trial for number in range(8) for trial in plan.trials(number))
    assert set(dealt.values()) == {2}
    assert len(EpisodePlan(("rotation",), (275, 300)).trials(5)) == 2


def test_who_cannot_do_a_task_is_left_out_by_rule():
    suite = frozen_suite("robust")
    entry = suite.entries[0]._replace(only=("rotation",))
    assert {case.episode.task for case in cases(suite, (entry,))} == {"rotation"}


@pytest.mark.parametrize("name", ["ppo", "ppo_ilc"])
def test_figures_of_a_shipped_policy_depend_on_its_files(name):
    files = {path.name for path in ControllerSpec(name).files}
    assert {"displacement-100hz-ppo.json", "displacement-100hz-ppo.safetensors"} <= files
    assert not any("tqc" in file for file in files) and not ControllerSpec("pid").files


def test_a_controller_that_can_do_none_of_a_suites_tasks_is_refused():
    with pytest.raises(SuiteError, match="ppo_ilc does displacement, rotation alone, and suite ex"):
        frozen_suite("exercise").entry(ControllerSpec("ppo_ilc"))


def test_hard_has_the_stations_of_robust():
    robust, hard = frozen_suite("robust"), frozen_suite("hard")
    assert hard.station(3).model is robust.station(3).model
    assert hard.environment["disturbances"] != "none" and hard.control_rate_hz == 50.0


def test_drawn_stations_have_one_structure_and_differ():
    suite = frozen_suite("robust")
    drawn = [suite.station(number) for number in range(6)]
    assert len({tuple(one.model.parameters) for one in drawn}) == 1
    assert len({dump_model(one.model) for one in drawn}) == 6
    assert len({one.present for one in drawn}) > 1
    for one in drawn:
        assert inability(one.model, suite.recipe) == ""


def test_a_station_depends_on_seed_and_number_alone():
    recipe = frozen_suite("robust").recipe
    again = draw_station(replace(recipe), 2).model
    assert dump_model(again) == dump_model(frozen_suite("robust").station(2).model)
    training = draw_station(replace(recipe, seed=recipe.training_seed), 2).model
    assert training.vector() != pytest.approx(again.vector())


def test_a_recipe_without_any_spread_gives_the_nominal_station():
    recipe = frozen_suite("robust").recipe
    effects = tuple(effect._replace(share=0.0) for effect in recipe.effects)
    still = draw_station(replace(recipe, widening=0.0, variation=0.0, effects=effects), 0).model
    courses = []
    for model in (load_model("station"), still):
        environment = PMAEnv(model=model, pressure_kpa=300, noise=False)
        environment.reset(seed=0)
        while environment.time < 3.0:
            environment.step(environment.action(4.0 * environment.time / 3.0))
        courses.append(environment.trajectory())
    assert np.abs(courses[0] - courses[1]).max() < 5e-6
    assert courses[0].max() > 10e-3


def test_a_station_that_cannot_do_the_tasks_is_told_why():
    recipe = frozen_suite("robust").recipe
    nominal = load_model("station")
    assert inability(nominal, recipe) == ""
    weak = nominal.replace({"drive.gain_n_per_v": 60.0})
    assert "it only reaches" in inability(weak, recipe)
    pulls = nominal.replace({"drive.offset_n": 3.0})
    assert inability(pulls, recipe) == "its drive pulls at 0 V"
    leaking = nominal.replace({"regulator_line.gain_kpa_per_v": 50.0})
    assert "regulator reaches" in inability(leaking, recipe)
    undamped = nominal.replace({"symmetric_damping.intercept_n_s_per_mm": -0.2})
    assert "damping" in inability(undamped, recipe)


def test_controllers_are_told_the_nominal_model_whatever_the_station(tmp_path):
    path = tmp_path / "spy.py"
    path.write_text(SPY)
    spec = ControllerSpec("Spy", path=str(path))
    rows = [
        run_case(Case(frozen_suite("robust"), spec, Episode(number, "displacement", 300, 0)))
        for number in (NOMINAL, 1)
    ]
    assert rows[0]["failure"] == rows[1]["failure"] == ""
    assert rows[0]["rmse"] != pytest.approx(rows[1]["rmse"], rel=1e-3)


def test_all_controllers_meet_the_same_noise():
    suite = frozen_suite("robust")
    rows = [run_case(Case(suite, ControllerSpec(n), suite.episodes[0])) for n in ("pid", "pid")]
    assert rows[0]["seed"] == rows[1]["seed"] == suite.seed_of(suite.episodes[0])
    assert rows[0]["phases"] == rows[1]["phases"]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("robst", "no suite 'robst': there are .*did you mean robust"),
        ("{0}/older.toml", "schema must be 2, got 1"),
        ("{0}/broken.toml", "broken.toml is not valid TOML: line 1"),
        ("{0}/unknown.toml", "unknown tasks: juggling; known: displacement"),
        ("{0}/effect.toml", "no effect 'sarosi' that a station may have or not"),
        ("{0}/range.toml", "creep needs a range or a tie for each of stiffness_n_per_mm, time"),
    ],
)
def test_a_suite_that_cannot_be_read_says_why(name, message, tmp_path):
    head = 'schema = 2\nname = "x"\ntitle = "x"\nversion = 1\nseed = 1\nmodel = "station"\n'
    head += "controllers = []\n[environment]\ncontrol_rate_hz = 100.0\n"
    plan = '[[episodes]]\ntasks = ["{0}"]\npressures_kpa = [300]\n'
    drawn = plan.format("displacement") + (
        "[stations]\ncount = 1\nseed = 1\ntraining_seed = 2\nwidening = 1.0\nvariation = 0.1\n"
        "reach_v = 9.0\ntrials = {}\n[[stations.effects]]\nshare = 0.5\n"
    )
    for file, text in {
        "broken": "schema = = 2",
        "older": head.replace("schema = 2", "schema = 1") + plan.format("displacement"),
        "unknown": head + plan.format("juggling"),
        "effect": head + drawn + 'name = "sarosi"\nranges = {}\n',
        "range": head + drawn + 'name = "creep"\nranges = { stiffness_n_per_mm = [0.1, 1.0] }\n',
    }.items():
        (tmp_path / f"{file}.toml").write_text(text)
    with pytest.raises(SuiteError, match=message):
        frozen_suite(name.format(tmp_path))
