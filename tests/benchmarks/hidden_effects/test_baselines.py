import importlib.util
import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import norm

from benchmarks.hidden_effects import bound
from benchmarks.hidden_effects.baselines import __main__ as command
from benchmarks.hidden_effects.baselines import (
    ablations,
    answers,
    balances,
    comparison,
    forest,
    gaussian_process,
    preparation,
    stepwise,
)
from benchmarks.hidden_effects.baselines.preparation import prepare
from benchmarks.hidden_effects.baselines.registry import BASELINES
from benchmarks.hidden_effects.baselines.signatures import signature
from benchmarks.hidden_effects.evaluation.verdicts import compare
from benchmarks.hidden_effects.generation import files
from benchmarks.hidden_effects.generation.cases import draw_case
from pma_gym.data.datasets.dataset import read_dataset
from pma_gym.discovery import workflow
from pma_gym.discovery.fitting.fit_problem import FitProblem
from pma_gym.discovery.fitting.free_parameters import free_parameters
from pma_gym.discovery.preparation.noise import white_noise
from pma_gym.discovery.screening import residuals, scan_statistic
from pma_gym.discovery.selection import stages
from pma_gym.plant.model import load_model

JUDGED = (1, 2, 3, 5, 101, 202)
"""Seeds of sets that were judged while building, and those of the final ones."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A small case that hides so much creep that no way can miss it."""
    path = tmp_path_factory.mktemp("drawn")
    case = draw_case(5, 1, "single", ("creep",), trials=3, seconds=4.0, ratio=(3.0, 3.0))
    files.write_case(case, path, 1)
    return path


@pytest.fixture(scope="module")
def dataset(folder):
    return read_dataset(folder / "cases" / "case_0001")


@pytest.fixture(scope="module")
def ready(dataset):
    return prepare(dataset, 1)


def test_the_criterion_is_that_of_a_regression():
    g = np.random.default_rng(0)
    n, terms = 200, g.standard_normal((200, 3))
    target = 2.0 * terms[:, 0] + g.standard_normal(n)
    values = []
    for count in (1, 3):
        _, rss, _, _ = np.linalg.lstsq(terms[:, :count], target)
        sigma = np.sqrt(rss[0] / n)
        likelihood = norm.logpdf(np.sqrt(rss[0] / n) * np.ones(n), scale=sigma).sum()
        values.append(-2.0 * likelihood + count * np.log(n))
        ours = stepwise.bic([rss[0]], [n], count)
        # Equal but for n (1 + log 2 pi), which no choice depends on.
        assert ours + n * (1.0 + np.log(2.0 * np.pi)) == pytest.approx(values[-1])
    assert values[0] < values[1]


def test_signals_count_with_variances_of_their_own():
    both = stepwise.bic([50.0, 8.0, 0.0], [100, 20, 0], 2)
    assert both == pytest.approx(100 * np.log(0.5) + 20 * np.log(0.4) + 2 * np.log(120))


def test_sparse_regression_recovers_a_planted_law():
    pytest.importorskip("pysindy")
    from benchmarks.hidden_effects.baselines.sparse import kept_terms

    g = np.random.default_rng(1)
    x, v = g.standard_normal((2, 4000))
    base = np.stack([x, v])
    terms = {"bend:x2": x**2, "dry": np.sign(v), "slow": np.sin(5.0 * x), "line": 3.0 * x}
    terms = {name: term - term.mean() for name, term in terms.items()}
    target = 5.0 * x + 0.6 * x**2 + 0.2 * g.standard_normal(4000)
    target = target - target.mean()
    terms_left = kept_terms(balances.Balance(target, base, terms))
    # What the model's own parameters make up is no term, and what explains little goes.
    assert set(terms_left) == {"bend:x2"}
    assert terms_left["bend:x2"] == pytest.approx(0.36 * 2 / (0.36 * 2 + 0.04), abs=0.03)


def test_balances_of_a_true_model_leave_little(ready):
    slide, drive, pressure, baseline = balances.balances(ready)
    rms = [float(np.sqrt(np.mean(each.residual**2))) for each in (slide, drive, pressure, baseline)]
    loads = np.concatenate([part[2] for part in ready.readings])
    # Forces of hundreds of N, of which creep is some.
    assert rms[0] < 0.1 * np.std(loads) and rms[1] < 0.03 * np.std(loads)
    for each in (slide, drive, pressure, baseline):
        lengths = {len(term) for term in each.terms.values()} | {each.base.shape[1]}
        assert lengths == {len(each.residual)}
        assert abs(float(each.residual.mean())) < 1e-9 * rms[0] + 1e-9


def test_a_signature_says_where_the_residual_is(ready):
    features = signature(ready)
    assert all(np.isfinite(list(features.values())))
    assert features["size of contraction"] > features["size of pressure"]
    louder = replace(ready, left=[2.0 * part for part in ready.left])
    again = signature(louder)
    assert again["size of contraction"] > features["size of contraction"]
    assert again["contraction along creep 2 s"] == pytest.approx(
        features["contraction along creep 2 s"]
    )


def test_the_forest_learns_from_no_judged_case(folder, tmp_path):
    known = forest.read_table(forest.TABLE)
    assert not set(known.seeds.tolist()) & set(JUDGED)
    assert set(known.seeds.tolist()) == {command.TRAINING_SEED}
    assert len(set(known.labels)) > 20 and forest.NOTHING in known.labels
    assert np.isfinite(known.values).all()
    forest.check_unseen(folder, forest.TABLE)
    (tmp_path / "truth").mkdir()
    truth = json.dumps({"seed": command.TRAINING_SEED})
    (tmp_path / "truth" / "case_0007.json").write_text(truth, "utf-8")
    with pytest.raises(ValueError, match="case_0007.*another seed"):
        forest.check_unseen(tmp_path, forest.TABLE)


def test_a_table_of_signatures_names_what_is_lacking(tmp_path):
    with pytest.raises(FileNotFoundError, match="baselines train"):
        forest.read_table(tmp_path / "none.csv")


FEW = ("creep", "drive_dead_zone")
CHEAP = ("bic_stepwise", "sparse_regression", "gaussian_process", "random_forest")


@pytest.mark.parametrize(
    "baseline",
    [
        pytest.param(name, marks=() if name == "sparse_regression" else pytest.mark.campaign)
        for name in CHEAP
    ],
)
def test_every_baseline_sees_much_creep(baseline, folder, dataset, monkeypatch):
    # The whole catalogue, pair by pair, would take a minute to compile and fit.
    few = [
        each
        for each in preparation.candidate_effects(load_model(dataset.model))
        if each.name in FEW
    ]
    monkeypatch.setattr(preparation, "candidate_effects", lambda model, orders: few)
    monkeypatch.setattr(gaussian_process, "MOST_BINS", 60)
    for name in BASELINES[baseline].needs:
        pytest.importorskip(name)
    answer = BASELINES[baseline].ask(dataset, 0, 1)
    truth = json.loads((folder / "truth" / "case_0001.json").read_text("utf-8"))
    outcome = compare(truth, json.loads(json.dumps(answer)))
    assert outcome.detected
    if baseline == "gaussian_process":
        assert outcome.verdict == "unknown" and not outcome.named
    if baseline == "bic_stepwise":
        assert outcome.hits == 1 and outcome.named[0] == "creep"


def test_each_part_is_off_while_a_diagnosis_runs_and_on_again(monkeypatch, dataset, ready):
    seen = {}

    def spied(*_, **__):
        own = workflow.free_parameters(ready.problem.given)
        noise = residuals.autoregression([np.sin(np.arange(400.0))], 0.1)
        seen.update(prior=own.prior, noise=noise, chance=stages.screen()[0].p_value)
        seen["bursts"] = scan_statistic.autoregression([np.sin(np.arange(400.0))], 0.1)

        class Nothing:
            def document(self):
                return {"parameters": {"a": 1}, "not_identifiable": {"a": 1}}

        return Nothing()

    score = stages.ScreeningScore(ready.catalogue[0], 7.9, 0.3, 0, 1.0, 1.0, None, ())
    monkeypatch.setattr(stages, "screen", lambda: [score])
    monkeypatch.setattr(ablations, "diagnose", spied)
    ablations.ours(dataset, 0, 1)
    prior, memory = seen["prior"], seen["noise"].coefficients
    assert memory
    answer = ablations.no_refit(dataset, 0, 1)
    assert np.allclose(seen["prior"], ablations.HELD * prior)
    assert answer["parameters"] == {} and answer["not_identifiable"] == {}
    ablations.no_whitening(dataset, 0, 1)
    assert seen["bursts"] == seen["noise"] == white_noise(pytest.approx(np.sqrt(0.5), rel=0.01))
    assert seen["chance"] == 0.3
    whole = stages.screen
    ablations.no_gate(dataset, 0, 1)
    assert seen["chance"] == 0.0 and stages.screen is whole
    ablations.ours(dataset, 0, 1)
    assert np.array_equal(seen["prior"], prior) and seen["noise"].coefficients == memory


def test_a_run_goes_on_and_counts_what_failed(folder, monkeypatch, tmp_path):
    asked = []

    def good(dataset, seed, jobs):
        asked.append(dataset.title)
        return {"verdict": "agrees", "effects": [], "parameters": {}, "gap": {}}

    def bad(dataset, seed, jobs):
        raise RuntimeError("out of luck")

    baselines = {
        name: SimpleNamespace(ask=ask, title=name, absence="")
        for name, ask in (("good", good), ("bad", bad))
    }
    for module in (answers, comparison):
        monkeypatch.setattr(module, "BASELINES", baselines)
    for _ in range(2):
        answers.ask_all(folder, ("good", "bad"), 1)
    assert len(asked) == 1
    document = comparison.compared(folder, ("good", "bad"))
    assert document["good"]["rates"]["detected"]["hits"] == 0
    assert document["good"]["rates"]["detected"]["n"] == 1
    assert document["bad"]["unanswered"] == ["case_0001: RuntimeError: out of luck"]
    shown = comparison.table(document, {})
    assert "0.0 % (0.0-79.3), 0 of 1" in shown and "out of luck" in shown


def test_a_way_names_what_it_lacks():
    for baseline in BASELINES.values():
        lacking = [name for name in baseline.needs if importlib.util.find_spec(name) is None]
        assert bool(baseline.absence) == bool(lacking)
        assert all(name in baseline.absence for name in lacking)


def test_the_true_noise_is_whitened():
    sensors = ("lvdt", "potentiometer", "load_cell", "pressure_transducer")
    truth = {
        "noise_factors": dict.fromkeys(sensors, 50.0),
        "noise_memory": dict.fromkeys(sensors, 0.4),
    }
    for noise in bound.true_noise(truth):
        # Noise far above the DAQ's steps is an autoregression of first order.
        assert noise.coefficients[0] == pytest.approx(0.4, abs=1e-3)
        assert np.allclose(noise.coefficients[1:], 0.0, atol=1e-3)
        assert noise.innovation == pytest.approx(noise.level * np.sqrt(1 - 0.4**2), rel=1e-3)


def test_the_distance_is_that_of_a_known_change(ready, dataset):
    """A wave on one signal that no parameter may follow: d^2 = sum of (wave / noise)^2."""
    given = ready.problem.given
    own = free_parameters(given)
    held = replace(own, prior=1e-6 * own.prior)
    noise = tuple(white_noise(level) for level in (2e-5, 2e-3, 0.5, 300.0))
    whitened = FitProblem(ready.problem.trials, given, held, noise).whitened_residuals(given)
    clean = whitened.readings(whitened.start)
    size, square = 30.0, 0.0
    for channel, name in ((3, "pressure"), (0, "contraction")):
        trials, square = [], 0.0
        for trial, held_there in zip(ready.problem.trials, clean, strict=True):
            readings = held_there.copy()
            wave = np.sin(2.0 * np.pi * 3.0 * (trial.time - trial.time[0]))
            readings[channel] += size * noise[channel].level / 300.0 * wave
            centred = wave - (wave.mean() if name == "contraction" else 0.0)
            square += float(np.sum((size / 300.0 * centred) ** 2))
            trials.append(bound._read(trial, readings.T))
        problem = FitProblem(trials, given, held, noise)
        fit = problem.fit(given)
        assert bound.left_by(problem, fit) == pytest.approx(np.sqrt(square), rel=1e-3)


def test_the_ideal_test_is_that_of_neyman_and_pearson():
    g = np.random.default_rng(2)
    distance, n = 3.0, 200_000
    nothing, there = g.standard_normal(n), g.standard_normal(n) + distance
    gate = np.quantile(nothing, 1.0 - bound.ALARM)
    assert bound.detected(distance) == pytest.approx(np.mean(there > gate), abs=0.02)
    assert bound.identified(distance) == pytest.approx(np.mean(there > 0.5 * distance), abs=0.005)


def test_curves_scale_with_the_size():
    case = {"effect": "creep", "r": 0.5, "nothing": 10.0, "likeness": 1.0, "rival": "slow_creep",
            "to_rival": 2.0, "to_rival_outside": 4.0}  # fmt: skip
    bounds = bound.curves([case])
    assert bounds["d_nothing"] == 20.0 and bounds["d_rival"] == 4.0
    at = bounds["r"].index(1.0)
    assert bounds["told"][at] == pytest.approx(norm.cdf(2.0))
    assert bounds["told_outside"][at] == pytest.approx(norm.cdf(4.0))
    assert np.all(np.diff(bounds["told"]) > 0.0)
