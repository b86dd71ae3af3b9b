"""The greatest likelihood is where simulated data came from, as surely as it says."""

from dataclasses import replace

import numpy as np
import pytest

from pma_gym import Plant
from pma_gym.data.trial import Trial
from pma_gym.estimation.innovations import log_likelihood
from pma_gym.estimation.likelihood_fit import Coordinate, _scored, fit, value_of, with_values
from tests.estimation.linear_slide import DAMPING, MASS_KG, NOISES, box, logged, point, slide

MASS = Coordinate("slide.mass", 1.0, True, 0.1, 100.0)
VISCOUS = Coordinate("symmetric_damping.intercept", DAMPING, False, 0.0, 1e4)
NOISE = Coordinate("noise 0", 1.0, True, 1e-7, 1e-3)
FORCE = Coordinate("force 0", 1.0, True, 1e-6, 1e2)
MEMORY = Coordinate("memory", 1.0, True, 0.01, 1.0)
ALL = (MASS, VISCOUS, NOISE, FORCE, MEMORY)
TRUE = dict(zip((c.name for c in ALL), (MASS_KG, DAMPING, NOISES[0], 2.0, 0.1), strict=True))
WRONG = {"slide.mass": 6.0, "symmetric_damping.intercept": 20.0, "noise 0": 3e-5, "force 0": 0.5}


@pytest.fixture(scope="module")
def linear():
    """A filter over one trial whose numbers are known."""
    return box([logged(rows=300)[0]], slide(), steps=8)


def test_what_the_plant_was_simulated_with_is_reached_from_afar():
    dry = {"static_n": 8.0, "dynamic_n": 8.0, "stribeck_speed_mm_per_s": 5.0, "presliding_um": 10.0}
    model, time = slide(coulomb_friction=dry), np.arange(0.0, 4.0, 0.01)
    generator, trials = np.random.default_rng(2), []
    for hertz in (0.7, 1.1):
        asked = Trial(
            time, {"load_command": 40.0 * np.sin(2 * np.pi * hertz * time) * (time > 0.1)}
        )
        exact = Plant(model).simulate(asked, noise=False).measurements["contraction"]
        noisy = exact + NOISES[0] * generator.standard_normal(time.size)
        trials.append(Trial(time, asked.commands, {"contraction": noisy}))
    made = box(trials, model, steps=32, linear=True)
    friction = Coordinate("coulomb_friction.dynamic", 10.0, False, 0.0, 1e3)
    free = (MASS, VISCOUS, friction, NOISE, FORCE, replace(FORCE, name="force 1"))
    wrong = {**WRONG, "coulomb_friction.dynamic": 4.0, "force 1": 0.5}
    tied = {"coulomb_friction.static": "coulomb_friction.dynamic"}
    best = fit(made, with_values(point(made), wrong), free, tied)
    for name, truth in (("slide.mass", MASS_KG), (VISCOUS.name, DAMPING), (friction.name, 8.0)):
        assert abs(value_of(best.point, name) - truth) < 3.0 * best.deviations[name], name
        assert best.deviations[name] < 0.02 * truth, name
    assert best.point.numbers["coulomb_friction.static"] == best.point.numbers[friction.name]
    assert best.point.deviations[0] == pytest.approx(NOISES[0], rel=0.1)
    # A latent force that is not there is not needed.
    assert max(best.point.forces) < 0.05


def test_the_optimum_is_higher_than_the_truth_and_its_neighbours_and_about_a_parabola(linear):
    best = fit(linear, with_values(point(linear), WRONG), ALL, {})
    truth = log_likelihood(linear.innovations([point(linear)]), linear.rows)[0]
    assert 0.0 < best.value - truth < 10.0
    for c in ALL:
        # One conditional standard error to either side costs a half.
        at, error = c.of(best.point), best.information[ALL.index(c), ALL.index(c)] ** -0.5
        beside = [best.moved(c.name, at + sign * error) for sign in (-1.0, 1.0)]
        lost = best.value - log_likelihood(linear.innovations(beside), linear.rows)
        assert 0.25 < lost.mean() < 1.0, c.name
        assert np.all(lost > 0.0), c.name


def test_scores_of_all_blocks_sum_to_the_gradient_of_the_log_likelihood(linear):
    away = with_values(point(linear), WRONG)

    def value(*points):
        return linear.innovations(points)

    def beside(step):
        return [with_values(away, {c.name: c.value(c.of(away) + step)}) for c in ALL]

    runs = np.arange(1, len(ALL) + 1)[None].repeat(len(linear.rows), axis=0)
    scores = _scored(linear, value(away, *beside(1e-4)), np.full(len(ALL), 1e-4), runs, 0 * runs)[1]
    up, down = (log_likelihood(value(*beside(step)), linear.rows) for step in (1e-4, -1e-4))
    gradient = (up - down) / 2e-4
    np.testing.assert_allclose(scores.sum(axis=0), gradient, rtol=3e-3, atol=0.1)
    assert np.abs(gradient).min() > 1.0


def test_a_filter_that_runs_away_beside_a_point_tells_no_slope(linear):
    """Readings that it throws out to 1e200 leave an information that is finite."""
    away = with_values(point(linear), WRONG)
    beside = [with_values(away, {c.name: c.value(c.of(away) + 1e-4)}) for c in ALL]
    ((errors, spreads),) = linear.innovations([away, *beside])
    errors[1, 40:] = 1e200
    runs = np.arange(1, len(ALL) + 1)[None]
    results, signs = [(errors, spreads)], np.full(len(ALL), 1e-4)
    information, scores = _scored(linear, results, signs, runs, 0 * runs)
    assert np.isfinite(information).all() and np.isfinite(scores).all()
    assert np.diag(information)[1:].min() > 0.0


@pytest.mark.parametrize("force", [1e-6, 1e-4, 1e-2])
def test_a_size_that_is_none_holds_no_other_number_back(force):
    """Its own step is of any length; with the whole step shortened by it a fit lost 300 of 4396."""
    model, time = slide(), np.arange(0.0, 4.0, 0.01)
    commands = {"load_command": 40.0 * np.sin(1.4 * np.pi * time) * (time > 0.1)}
    exact = Plant(model).simulate(Trial(time, commands), noise=False).measurements["contraction"]
    noisy = exact + NOISES[0] * np.random.default_rng(2).standard_normal(time.size)
    made = box([Trial(time, commands, {"contraction": noisy})], model, steps=8, linear=True)
    start = with_values(point(made), {**WRONG, "force 0": force})
    free = (MASS, VISCOUS, NOISE, replace(FORCE, lower=1e-12), MEMORY)
    without = with_values(start, {"force 0": 1e-12})
    assert fit(made, start, free, {}).value > fit(made, without, free[:3], {}).value - 0.1


@pytest.mark.parametrize(("low", "high", "end"), [(0.1, 4.0, 4.0), (6.0, 9.0, 6.0)])
def test_bounds_are_kept_and_the_others_are_the_best_beside_them(linear, low, high, end):
    start = with_values(point(linear), {"slide.mass": 0.5 * (low + high)})
    best = fit(linear, start, [replace(MASS, lower=low, upper=high), *ALL[1:]], {})
    assert best.point.numbers["slide.mass"] == pytest.approx(end, rel=1e-12)
    alone = fit(linear, with_values(start, {"slide.mass": end}), ALL[1:], {})
    assert best.value == pytest.approx(alone.value, abs=0.2)


def test_a_prior_draws_towards_the_start_by_its_width(linear):
    start = with_values(point(linear), {"slide.mass": 6.0})
    ends = [
        fit(linear, start, [replace(MASS, prior=width), *ALL[1:]], {}).point.numbers["slide.mass"]
        for width in (1e-4, 0.02, 10.0)
    ]
    assert ends[0] == pytest.approx(6.0, rel=1e-3)
    assert ends[2] < ends[1] < ends[0]


def test_standard_errors_are_the_scatter_of_fits():
    scores = []
    for seed in range(20):
        made = box([logged(seed, rows=150)[0]], slide())
        best = fit(made, point(made), ALL, {})
        scores.append(
            [(value_of(best.point, n) - TRUE[n]) / best.deviations[n] for n in list(TRUE)[:3]]
        )
    scatter = np.std(scores, axis=0)
    assert np.all((scatter > 0.6) & (scatter < 1.6)), scatter
    assert np.all(np.abs(np.mean(scores, axis=0)) < 3.0 / 20**0.5)
