"""Candidates that could not be fitted are listed; those whose score promised too much are not."""

from dataclasses import replace

import pytest

from pma_gym.discovery.screening.candidates import candidate_effects
from pma_gym.discovery.screening.probe_scores import Baseline
from pma_gym.discovery.screening.score_test import screen
from pma_gym.discovery.selection.candidate_fits import stripped, unfitted
from tests.discovery.laboratory import STATION, fit_problem, laboratory

HIDDEN, OTHER = "hysteresis", "load_cell_error"


@pytest.fixture(scope="module")
def scored():
    problem = fit_problem(laboratory("hysteresis")[0])
    before = problem.careful_fit(STATION)
    assert before is not None
    whitened = problem.whitened_residuals(before.model)
    baseline = Baseline.at(whitened, before.values, before.steps)
    candidates = [each for each in candidate_effects(STATION) if each.name in (HIDDEN, OTHER)]
    plain = stripped(problem, before)
    scores = screen(baseline, candidates, 0, lambda each: problem.probed(plain, each))
    return problem, baseline, before, {each.candidate.name: each for each in scores}


def test_an_effect_that_is_there_and_has_no_fit_is_listed(scored):
    problem, baseline, before, scores = scored
    assert unfitted(problem, baseline, before, (), [scores[HIDDEN]], {}) == (HIDDEN,)


def test_a_promise_that_no_refit_keeps_lists_nothing(scored):
    """Parameters that follow along straight lines seem to leave a gain; a refit has none."""
    problem, baseline, before, scores = scored
    promised = replace(scores[OTHER], gain=2.0 * scores[HIDDEN].gain)
    assert unfitted(problem, baseline, before, (), [promised], {}) == ()
