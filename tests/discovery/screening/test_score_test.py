"""Score test: chance is fair, the hidden effect stands out, what parameters do is taken out."""

from dataclasses import replace

import numpy as np
import pytest

from pma_gym.discovery.screening import probe_scores
from pma_gym.discovery.screening.candidates import candidate_effects
from pma_gym.discovery.screening.probe_scores import Baseline
from pma_gym.discovery.screening.score_test import screen
from pma_gym.discovery.screening.starting_points import starting_points
from tests.discovery.laboratory import DELAY, HYSTERESIS, STATION, fit_problem, measured

CANDIDATES = candidate_effects(STATION)
HIDDEN = {
    "hysteresis": HYSTERESIS,
    "regulator_delay": DELAY,
    "creep": {"creep": {"stiffness_n_per_mm": 0.6, "time_constant_s": 1.5}},
    "drive_saturation": {"drive_saturation": {"limit_n": 400.0}},
    "regulator_asymmetry": {"regulator_asymmetry": {"vent_ratio": 1.3}},
}


@pytest.fixture(scope="module")
def quiet():
    """Trials without noise, and what each candidate changes in them."""
    shared = fit_problem(measured(STATION, 4, rate=32.0, noise=False))
    return shared, Remembered(shared)


class Remembered:
    """Whitened residuals of candidates whose simulations are kept."""

    def __init__(self, shared):
        self.shared, self.kept = shared, {}

    def __call__(self, candidate):
        whitened = self.shared.probed(STATION, candidate)

        def columns(tried):
            if candidate.name not in self.kept:
                self.kept[candidate.name] = type(whitened).columns(whitened, tried)
            return self.kept[candidate.name]

        whitened.columns = columns
        return whitened


def baseline(shared):
    whitened = shared.whitened_residuals(STATION)
    steps = 1e-3 * np.maximum(np.abs(whitened.start), 0.01)
    return Baseline.at(whitened, whitened.start, steps)


def with_residual(base, rows):
    """The baseline with another residual; rows of shape (4, n) for each trial, whitened."""
    columns = []
    for part, row in zip(base.columns, rows, strict=True):
        other = part.copy()
        other[0] = row
        columns.append(other)
    return replace(base, columns=columns)


def noise(base, seed):
    generator = np.random.default_rng(seed)
    return [generator.standard_normal(part[0].shape) for part in base.columns]


HYSTERETIC = next(each for each in CANDIDATES if each.name == "hysteresis")


def probed(shared):
    """Scores of all candidates in trials, by name."""
    scores = screen(baseline(shared), CANDIDATES, 0, lambda each: shared.probed(STATION, each))
    return {each.candidate.name: each for each in scores}


def test_chance_is_fair(quiet):
    shared, whitened_of = quiet
    base = baseline(shared)
    drawn = [with_residual(base, noise(base, seed)) for seed in range(30)]
    scores = [screen(each, CANDIDATES, seed, whitened_of) for seed, each in enumerate(drawn)]
    least = np.array([min(each.p_value for each in of_one) for of_one in scores])
    # Family-wise: of the least over the whole catalogue. 0.053 is the standard error of the mean.
    assert 0.3 < least.mean() < 0.7
    assert np.sum(least < 0.1) <= 9
    assert np.sum(least <= 0.005) <= 1


@pytest.mark.parametrize("name", HIDDEN)
def test_what_is_hidden_stands_out(name):
    shared = fit_problem(measured(STATION.with_effects(HIDDEN[name]), 4))
    best = max(probed(shared).values(), key=lambda each: each.gain)
    assert best.candidate.name == name
    assert best.gain > 100 and best.change > 0.3
    assert best.probe >= 0 and best.starts[0][0] == best.probe


def test_what_parameters_can_do_is_not_an_effects(quiet):
    shared, whitened_of = quiet
    base = baseline(shared)
    for path in ("drive.gain_n_per_v", "contractile_force.slope_n_per_kpa", "rotor.radius_mm"):
        at = shared.own.free.index(path)
        shape = [part[1 + at].astype(float) for part in base.columns]
        size = np.sqrt(sum(np.sum(row**2) for row in shape))
        moved = with_residual(base, [1000.0 * row / size for row in shape])
        # A million of chi-square, of which no effect may take any: the prior holds a little.
        assert max(each.gain for each in screen(moved, CANDIDATES, 0, whitened_of)) < 25.0


def test_what_an_effect_does_is_all_its_own(quiet):
    """A residual that is a probe's change to the letter is explained by factor 1."""
    shared, whitened_of = quiet
    base, probe = baseline(shared), int(np.argmax(HYSTERETIC.probes[:, 0]))
    assert screen(base, [HYSTERETIC], 0, whitened_of)[0].gain < 25.0
    rows = [-part[1 + probe].astype(float) for part in whitened_of.kept["hysteresis"]]
    scores = screen(with_residual(base, rows), CANDIDATES, 0, whitened_of)
    best = max(scores, key=lambda each: each.gain)
    assert (best.candidate.name, best.probe) == ("hysteresis", probe)
    assert best.factor == pytest.approx(1.0, rel=1e-3)
    # An effect of one sign does not explain its opposite.
    assert not HYSTERETIC.signs.any()
    (against,) = screen(with_residual(base, [-r for r in rows]), [HYSTERETIC], 0, whitened_of)
    assert against.gain < 0.05 * best.gain


def test_what_no_trial_excites_is_never_resolved():
    """Pressure of a resting regulator says nothing of its delay."""
    scores = probed(fit_problem([measured(STATION, 4)[k] for k in (0, 2, 3)]))
    undetected = scores["regulator_delay"]
    assert (undetected.gain, undetected.p_value, undetected.resolvable) == (0.0, 1.0, None)
    assert scores["hysteresis"].resolvable is not None


def test_larger_effects_are_resolved_sooner(quiet):
    shared, _ = quiet
    plain, twice = map(probed, (shared, replace(shared, trials=[*shared.trials] * 2)))
    for name in ("hysteresis", "creep", "regulator_delay"):
        ratio = twice[name].resolvable / plain[name].resolvable
        assert ratio == pytest.approx(1 / np.sqrt(2), rel=0.05)


def test_fits_begin_where_most_is_explained():
    shared = fit_problem(measured(STATION.with_effects(HYSTERESIS), 4))
    base, whitened = baseline(shared), shared.probed(STATION, HYSTERETIC)
    (scores,) = screen(base, [HYSTERETIC], 0, lambda _: whitened)
    (first, *_) = starting_points(base, whitened, scores)
    assert 3.0 < first[HYSTERETIC.paths.index("hysteresis.force_n")] < 12.0


def test_the_seed_alone_draws_chance(quiet):
    shared, whitened_of = quiet
    base = baseline(shared)
    base = with_residual(base, noise(base, 5))
    one, same, other = (screen(base, CANDIDATES, seed, whitened_of) for seed in (1, 1, 2))
    assert [each.p_value for each in one] == [each.p_value for each in same]
    assert [each.p_value for each in one] != [each.p_value for each in other]
    assert [each.gain for each in one] == [each.gain for each in other]


def test_probes_change_what_each_does_alone_beside_one_that_has_no_balance():
    shared = fit_problem(measured(STATION, 2, rate=32.0))
    whitened = shared.whitened_residuals(STATION)
    tried = np.tile(whitened.start, (4, 1))
    # A muscle that pushes holds no load.
    tried[1:, shared.own.free.index("contractile_force.slope_n_per_kpa")] *= [1.01, -4.0, 0.99]
    assert whitened.columns(tried) is None
    assert whitened.balanced.tolist() == [True, True, False, True]
    together = probe_scores._balanced(whitened, tried)
    alone = probe_scores._one_by_one(whitened, tried)
    for ours, theirs in zip(together, alone, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-6, atol=1e-9)
        assert ours[1].any() and ours[3].any() and not ours[2].any()
