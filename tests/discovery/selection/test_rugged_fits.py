"""Fits that bear a rugged chi-square: dry friction with a static level that a slide sticks by.

Two effects of a free rig that is far from its model: found in short pieces of its trials.
"""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from benchmarks.hidden_effects.rigs import laws
from benchmarks.hidden_effects.rigs.rig import Rig
from benchmarks.hidden_effects.rigs.simulators import stick_slip
from benchmarks.hidden_effects.rigs.simulators.drive import Transmission
from pma_gym.data.datasets.dataset import NamedTrial
from pma_gym.data.trial import Trial
from pma_gym.discovery.fitting import derivative_free
from pma_gym.discovery.fitting.derivative_free import refined
from pma_gym.discovery.fitting.fewer_pieces import PIECES, with_fewer_pieces
from pma_gym.discovery.fitting.fit_problem import FitProblem
from pma_gym.discovery.fitting.free_parameters import free_parameters
from pma_gym.discovery.fitting.journal import Journal
from pma_gym.discovery.fitting.short_pieces import in_short_pieces
from pma_gym.discovery.preparation.noise import white_noise
from pma_gym.discovery.preparation.prepared_trials import prepared
from pma_gym.discovery.screening.candidates import candidate_effects
from pma_gym.discovery.selection import rugged_fits
from pma_gym.discovery.selection.candidate_fits import refit
from pma_gym.discovery.selection.rugged_fits import (
    FIRST,
    STARTS,
    best_of_optima,
    is_rugged,
    settled,
)
from pma_gym.discovery.workflow import diagnose
from pma_gym.effects import CATALOGUE
from pma_gym.plant.model import Model, load_model
from tests.discovery.rig_trials import FROZEN, driven_slide

MODEL = load_model(FROZEN / "driven_slide" / "model.toml")
DRY = next(each for each in candidate_effects(MODEL) if each.name == "coulomb_friction")
DYNAMIC, STATIC = "coulomb_friction.dynamic_n", "coulomb_friction.static_n"


def problem_of(trials):
    named, _ = prepared([NamedTrial(f"{k}", trial) for k, trial in enumerate(trials)], MODEL)
    return FitProblem(
        [each.trial for each in named], MODEL, free_parameters(MODEL), (white_noise(1e-5),) * 2
    )


def fit_from(problem, *begun):
    """A fit of the whole law, begun at static, dynamic (N) and Stribeck's speed (mm/s)."""
    start = np.array([*begun, *DRY.absent[len(begun) :]])
    fit = problem.fit(MODEL, (DRY,), {DRY.name: start})
    assert fit is not None
    return fit


@cache
def rubbing(lanes=2, seconds=0.5):
    """A slide with 12 N of dry friction, and a fit of it near its size."""
    problem = problem_of(driven_slide(12.0, lanes=lanes, seconds=seconds, rate=100))
    return problem, fit_from(problem, 14.0, 12.0, 10.0)


def test_a_fit_that_stops_far_off_is_begun_again_at_the_simpler_law():
    problem = problem_of(driven_slide(12.0, lanes=3, seconds=0.7, rate=100))
    fit = fit_from(problem, 30.0, 10.0, 0.5)
    assert is_rugged(fit, (DRY,))
    best = best_of_optima(problem, fit, (DRY,))
    assert best.chi_square < 0.5 * fit.chi_square
    assert best.estimate(DYNAMIC)[0] == pytest.approx(12.0, rel=0.05)
    for path, value in zip(best.paths, best.values, strict=True):
        low, high = best.spread[path]
        assert low <= value <= high


@pytest.mark.parametrize(("least", "begun"), [(96.0, FIRST), (94.0, len(STARTS))])
def test_more_beginnings_are_tried_where_the_whole_law_explains_more(least, begun, monkeypatch):
    """Of a chi-square of 100 that one number leaves, it must explain 5 with the first of them."""
    problem, fit = rubbing(1, 0.3)
    left = iter([98.0, least, *([99.0] * len(STARTS))])
    monkeypatch.setattr(rugged_fits, "_simpler", lambda *_: replace(fit, chi_square=100.0))
    monkeypatch.setattr(FitProblem, "eased_fit", lambda *_: replace(fit, chi_square=next(left)))
    assert len(list(rugged_fits._fits_from_simpler_laws(problem, fit, (DRY,)))) == begun


def test_no_start_lies_beyond_what_is_looked_for():
    """Friction of 9590 N m began at 1.1 times that: the catalogue ends at 10000, and no answer."""
    problem, fit = rubbing(1, 0.3)
    (tie,) = rugged_fits.ties(DRY)
    size = fit.estimate(DYNAMIC)[0]
    bounded = replace(DRY, highest={STATIC: 1.2 * size, DYNAMIC: 1.2 * size})
    begun = [start[STATIC] for start in rugged_fits._starts(bounded, tie, fit)]
    assert max(begun) == pytest.approx(1.2 * size) and min(begun) == pytest.approx(1.1 * size)


def test_a_law_that_one_number_takes_the_place_of_is_not_refined():
    problem, fit = rubbing()
    below = replace(fit, values=np.where(np.array(fit.paths) == STATIC, 3.0, fit.values))
    assert settled(problem, below, (DRY,)) is below


def test_a_refined_fit_explains_more_and_says_what_it_explains():
    problem, fit = rubbing()
    refit = refined(problem, fit, (DRY,))
    assert refit.chi_square < fit.chi_square
    again = problem.whitened_at(refit, (DRY,)).sums(refit.values, np.empty(0))
    assert refit.chi_square == pytest.approx(again.chi_square, rel=1e-9)


def test_a_simplex_that_gains_nothing_is_followed_by_a_narrower_one(monkeypatch):
    """The same again ends the same: the second begins a quarter as wide, and shrinks."""
    problem, fit = rubbing()
    sizes = []

    def by_simplex(problem, fit, chosen, size, most):
        sizes.append(size)
        gains = len(sizes) == 2
        reached = replace(fit, chi_square=0.5 * fit.chi_square) if gains else fit
        return derivative_free._Ended(reached, len(sizes) == 4, 1)

    monkeypatch.setattr(derivative_free, "_by_simplex", by_simplex)
    assert refined(problem, fit, (DRY,), narrows=True).converged
    assert sizes == [1.0, 0.25, 1.0, 0.25]
    # While others are still to be compared, the first that gains nothing is the last.
    assert not refined(problem, fit, (DRY,)).converged
    assert sizes == [1.0, 0.25, 1.0, 0.25, 1.0]


def test_simplices_of_a_stiff_contact_stop_and_say_so(monkeypatch):
    problem, fit = rubbing()
    whole = refined(problem, fit, (DRY,))
    monkeypatch.setattr(derivative_free, "MOST_STEPS", 20_000)
    begun, simulated = [], FitProblem.whitened_at
    monkeypatch.setattr(
        FitProblem, "whitened_at", lambda *given: begun.append(simulated(*given)) or begun[-1]
    )
    short = refined(problem, fit, (DRY,))
    assert not short.converged
    assert whole.chi_square < short.chi_square <= fit.chi_square
    # No simulation is begun once the steps are spent.
    assert 20_000 < sum(each.attempts for each in begun) < 22_000


def test_short_pieces_begin_where_the_slide_moves_fastest():
    problem = problem_of(driven_slide(12.0, lanes=2, seconds=2.0, rate=100))
    short = in_short_pieces(problem)
    assert set(short.wholes) == set(range(4)) and len(short.trials) > 8
    for whole, piece in zip(short.wholes, short.trials, strict=True):
        trial = problem.trials[whole]
        speeds = np.abs(np.gradient(trial.measurements["contraction"], trial.time))
        at = int(np.searchsorted(trial.time, piece.time[0]))
        assert speeds[at] >= speeds[max(at - 2, 0) : at + 2].max()
        rows = slice(at, at + len(piece))
        np.testing.assert_array_equal(
            piece.measurements["contraction"], trial.measurements["contraction"][rows]
        )


def test_a_piece_has_what_belongs_to_its_whole_trial():
    trials = driven_slide(12.0, lanes=2, seconds=2.0, rate=100)
    short = in_short_pieces(problem_of(trials))
    own = replace(DRY, own={"start.velocity_mm_per_s": [1e-3, 2e-3, 3e-3, 4e-3]})
    whitened = short.whitened_residuals(DRY.model, (own,))
    ((_, given),) = whitened._own
    np.testing.assert_array_equal(given, 1e-3 * (1 + np.array(short.wholes)))


@pytest.mark.parametrize(
    ("differences", "chance"),
    [([9.0, -8.0, 5.0, -3.0], True), ([4.0, 5.0, 6.0, 5.0], False), ([np.inf, 1.0], False)],
)
def test_fits_are_equal_where_their_difference_is_chance(differences, chance):
    assert rugged_fits._is_by_chance(np.array(differences)) is chance


RATE, SECONDS, STEP = 100.0, 4.0, 2e-6
AXIS = Rig("slide", 3.0, 20.0, 0.0, 0.0, 0.0, 0.015, 1.5, RATE)
HIDDEN = (laws.CoulombFriction(8.0), laws.DirectionalDamping(12.0))


def given():
    tables = {
        "two_way_drive": {"gain_n_per_v": 100.0, "middle_v": 5.0},
        "slide": {"mass_kg": 3.0},
        "symmetric_damping": {"intercept_n_s_per_mm": 0.02, "slope_n_s_per_mm_per_kpa": 0.0},
        "start": {"contraction_mm": 0.0, "velocity_mm_per_s": 0.0},
        "lvdt": {"bandwidth_hz": 1000.0, "noise_mm": 1e3 * STEP},
    }
    return Model("axis", "An axis", "slide", {n: CATALOGUE[n].parse(t) for n, t in tables.items()})


def controlled(seed):
    """A trial of the axis in a loop; a force of the simulator contracts."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(SECONDS * RATE)) / RATE
    phases = rng.uniform(0.0, 2.0 * math.pi, 3)
    tones = zip((0.7, 1.1, 1.6), phases, strict=True)
    wanted = 0.01 * sum(np.sin(2.0 * math.pi * hertz * time + p) - np.sin(p) for hertz, p in tones)
    last = [0.0]

    def force(row, q):
        slope, last[0] = (q - last[0]) * RATE, q
        return 3000.0 * (wanted[row] - q) - 60.0 * slope

    motion = stick_slip.simulate(AXIS, HIDDEN, Transmission(), force, len(time))
    read = STEP * np.round(motion.q / STEP)
    return Trial(time, {"load_command": -motion.command}, {"contraction": read})


@pytest.mark.campaign
def test_friction_and_damping_by_direction_are_found_together():
    diagnosis = diagnose([controlled(1)], given(), propose=False)
    named = {each.name: each for each in diagnosis.effects}
    assert set(named) == {"coulomb_friction", "directional_damping"}, diagnosis.sentence
    dynamic = named["coulomb_friction"].parameters["dynamic_n"].value
    assert dynamic == pytest.approx(8.0, rel=0.05)
    difference = named["directional_damping"].parameters["difference_n_s_per_mm"].value
    assert abs(difference) == pytest.approx(0.012, rel=0.1)


def test_a_journal_tells_fits_of_short_pieces_from_those_of_the_trials(tmp_path):
    """Also where both begin, or end, at the same values."""
    problem = problem_of([*driven_slide(12.0, lanes=2, seconds=2.0, rate=50)])
    short = in_short_pieces(problem)
    begun = problem.fit(problem.given)
    assert begun is not None
    journal = Journal(tmp_path, problem.trials, problem.given, "one question")
    both = {id(each): refit(each, begun, (), journal) for each in (short, problem)}
    assert both[id(short)].chi_square != both[id(problem)].chi_square
    for each in (short, problem):
        again = refit(each, begun, (), journal)
        assert again.chi_square == both[id(each)].chi_square == each.fit(begun.model).chi_square


def test_searches_use_at_most_half_of_the_pieces_evenly():
    problem = problem_of([*driven_slide(12.0, lanes=3, seconds=9.0, rate=50)])
    files = tuple(f"{number // 9}" for number in range(len(problem.trials)))
    pieces = replace(problem, files=files)
    fewer = with_fewer_pieces(pieces)
    assert len(pieces.trials) > 2 * PIECES and len(fewer.trials) == PIECES
    assert set(fewer.files) == set(files) and len(set(fewer.wholes)) == PIECES
    for whole, piece in zip(fewer.wholes, fewer.trials, strict=True):
        assert piece is pieces.trials[whole]
    again = with_fewer_pieces(replace(pieces, trials=pieces.trials[:10], files=files[:10]))
    assert len(again.trials) == 10
    # Whole trials may each have a condition of their own.
    assert with_fewer_pieces(problem) is problem
