"""Errors of parameters: as the curvature says for noise, wider where a model is wrong; scatter.

Intervals count what a further effect beside the named ones would make of a parameter.

Terms of one law have one size: friction that grows almost in proportion to the pressure.
"""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from pma_gym.data.trial import Trial
from pma_gym.discovery.answer.estimates import _shifts_beside
from pma_gym.discovery.fitting.covariance import LEAST_STRETCHES, clusters, covariance
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted, _shown
from pma_gym.discovery.fitting.free_parameters import free_parameters
from pma_gym.discovery.preparation.noise import white_noise
from pma_gym.discovery.preparation.whitened_residuals import Pieces
from pma_gym.discovery.screening.candidates import candidate_effects
from pma_gym.discovery.selection.candidate_fits import LEAST_GAIN
from pma_gym.discovery.verdict.homogeneity_test import homogeneity_test, newton_step
from pma_gym.discovery.verdict.unknown import MOST_SPREAD
from pma_gym.estimation.least_squares import inverse
from pma_gym.plant import sensors
from pma_gym.plant.plant import Plant
from tests.discovery.laboratory import HYSTERESIS, STATION, commanded, fit_problem, measured
from tests.plant.test_imposed import imposed

LAW = next(each for each in candidate_effects(STATION) if each.name == "hysteresis")
START = {"hysteresis": np.array([6.0, 1.0])}


def widened(trials):
    """By how much errors exceed those of the curvature, for what the data determine."""
    shared = fit_problem(trials)
    fit = shared.fit(STATION)
    assert fit is not None
    known = np.isfinite(np.diag(fit.covariance))
    wide = covariance(shared, fit, ())
    return np.sqrt(np.diag(wide)[known] / np.diag(fit.covariance)[known])


def test_a_parameter_that_shows_by_rounding_alone_leaves_others_their_errors():
    """Its slopes, of 1e-10, are in proportion to another's."""
    slopes = np.array([[2.0, 2e-10], [1.0, 1e-10]])
    curvature, widths = slopes.T @ slopes, np.array([100.0, 100.0])
    assert np.isinf(np.diag(inverse(curvature))).all()
    variances = np.diag(inverse(_shown(curvature, widths)))
    assert variances[0] == pytest.approx(1.0 / 5.0) and np.isinf(variances[1])
    shown = np.diag([5.0, 1e-3])
    np.testing.assert_array_equal(_shown(shown, widths), shown)


def test_white_noise_hardly_widens_errors():
    wider = widened(measured(STATION, 6, noise=True))
    assert np.all(wider >= 1.0)
    assert np.median(wider) < 1.3


def test_what_is_left_for_seconds_widens_errors():
    def wandering(trial, seed):
        white = np.random.default_rng(seed).standard_normal(len(trial))
        slow = lfilter([0.3], [1.0, -0.95], white) * 1e-4
        held = trial.measurements["contraction"] + np.asarray(slow)
        return Trial(trial.time, trial.commands, {**trial.measurements, "contraction": held})

    trials = measured(STATION, 6)
    slow = [wandering(trial, seed) for seed, trial in enumerate(trials)]
    assert widened(slow).max() > 2.0
    assert widened(slow).max() > 1.5 * widened(trials).max()


def lengths(trials, runs=()):
    """Trials of so many pieces: in how many clusters they are, for each way of making clusters."""
    trial = np.repeat(np.arange(len(trials)), trials)
    pieces = Pieces(np.zeros((len(trial), 1, 1)), trial, np.ones(len(trial), int))
    return [len(np.unique(group)) for group in clusters(pieces, runs)]


def test_stretches_grow_until_there_are_few():
    # 64 pieces of a quarter of a second each: stretches of 1, 2 and 4 s, and no longer ones.
    assert lengths([64, 64, 64]) == [48, 24, 12]
    assert min(lengths([64, 64, 64])) >= LEAST_STRETCHES
    # Trials count where there are four.
    assert lengths([64] * 4) == [64, 32, 16, 4]


def test_pieces_of_one_run_are_one_after_the_other():
    assert lengths([4] * 12, [0] * 12) == [12, 12]
    assert lengths([4] * 24, [0] * 24) == [24, 12, 24]
    assert lengths([4] * 24, [0] * 12 + [1] * 12) == [24, 12, 24]


@cache
def scatter(*forces):
    """Spread of hysteresis whose force (N) differs from trial to trial."""
    models = [
        STATION.with_effects({"hysteresis": HYSTERESIS["hysteresis"] | {"force_n": force}})
        for force in forces
    ]
    trials = [
        Plant(model).simulate(trial, seed=k, noise=True)
        for k, (model, trial) in enumerate(
            zip(models, commanded(len(forces), kinds=(0,)), strict=True)
        )
    ]
    shared = fit_problem(trials)
    fit = shared.fit(STATION, (LAW,), START)
    assert fit is not None
    return homogeneity_test(shared, fit, (LAW,), 0)


def test_an_effect_of_one_size_does_not_scatter():
    scattered = scatter(6.0, 6.0, 6.0, 6.0)
    assert set(scattered) == {"trial", "contraction", "load", "pressure"}
    assert max(scattered.values()) < 0.05


def test_an_effect_of_two_sizes_scatters_by_trial_as_it_was_made():
    # A third of the mean of 6 N.
    assert scatter(4.0, 8.0, 4.0, 8.0)["trial"] == pytest.approx(1.0 / 3.0, abs=0.12)


def linear(sizes, sharpness, away):
    """Spread by trial of an effect in linear trials, beside one parameter of the model's own.

    Args:
        sizes: of the effect in each trial.
        sharpness: how many times as sharply each trial sees it.
        away: how many standard errors the fit is from the least chi-square.
    """
    generator, rows = np.random.default_rng(4), 200
    columns = [k * generator.normal(size=(rows, 2)) for k in sharpness]
    noise = [generator.normal(size=rows) for _ in sizes]
    measured = [c @ [size, 1.0] + n for c, size, n in zip(columns, sizes, noise, strict=True)]
    best = np.linalg.lstsq(np.concatenate(columns), np.concatenate(measured), rcond=None)[0]
    curvature = sum(c.T @ c for c in columns)
    values = best + away / np.sqrt(np.diag(curvature))
    stacked = [np.column_stack([c @ values - m, c]) for c, m in zip(columns, measured, strict=True)]
    trial = np.arange(len(sizes))
    whitened = SimpleNamespace(
        pieces=lambda *_: Pieces(np.array([s.T @ s for s in stacked]), trial, 0 * trial + rows),
        readings=lambda *_: None,
        prior=np.full(2, np.inf),
        centre=np.zeros(2),
        lower=np.full(2, -np.inf),
        upper=np.full(2, np.inf),
    )
    none, one = np.zeros(1), np.ones(1, bool)
    law = SimpleNamespace(
        effect="hysteresis",
        paths=("law.size",),
        fitted_paths=["law.size"],
        absent=none,
        amplitudes=one,
        fitted=one,
    )
    fit = SimpleNamespace(model=None, paths=("law.size", "own"), values=values, steps=None)
    problem = SimpleNamespace(whitened_at=lambda *_: whitened, files=(), trials=sizes)
    return homogeneity_test(problem, fit, (law,), 0)["trial"]


def test_a_trial_that_sees_an_effect_sharply_does_not_scatter_the_others():
    # A tenth of an error is nothing, but times 1000 it is more than all that the others show.
    scattered = [
        linear((1.0,) * 4, (1.0, 1.0, 1.0, 1e3), away) for away in np.linspace(-0.3, 0.3, 61)
    ]
    assert max(scattered) < 0.1


def test_what_scatters_does_so_wherever_the_fit_stopped():
    sizes, sharpness = (0.4, 1.6, 0.4, 1.6), (1.0, 1.0, 1.0, 3.0)
    scattered = [linear(sizes, sharpness, away) for away in (0.0, -0.3, 0.3)]
    assert scattered[0] > 0.2
    assert scattered[1:] == pytest.approx([scattered[0]] * 2, rel=0.02)


def test_the_last_step_ends_where_a_bound_holds_a_parameter():
    """The first held, the second goes to its own least; none held, both to the joint one."""
    curvature, gradient = np.array([[2.0, 1.8], [1.8, 2.0]]), np.array([3.0, 1.0])
    held = newton_step(gradient, curvature, np.array([False, True]))
    assert held == pytest.approx([0.0, -0.5])
    joint = newton_step(gradient, curvature, np.array([True, True]))
    assert curvature @ joint + gradient == pytest.approx([0.0, 0.0])
    assert not newton_step(gradient, curvature, np.array([False, False])).any()


MASS, DRAG, FRICTION = "slide.mass_kg", "drag.coefficient", "friction.force"


def fit(chi_square, **values):
    """A fit of a mass with effects of one parameter each."""
    paths = {"mass": MASS, "drag": DRAG, "friction": FRICTION}
    names = tuple(name for name in values if name != "mass")
    model, steps = SimpleNamespace(), np.zeros(len(values))
    at = tuple(paths[name] for name in values)
    numbers = np.array(list(values.values()))
    return Fitted(model, names, at, numbers, np.eye(len(at)), chi_square, steps, True)


def diagnosed(*beside, named=("drag",)):
    """A drag is named; fits of a friction beside it, in the last round."""
    before = fit(1000.0, mass=5.0, drag=2.0)
    last = SimpleNamespace(before=before, fits=dict(enumerate(beside)))
    chosen = tuple(SimpleNamespace(name=name) for name in named)
    return SimpleNamespace(
        selection=SimpleNamespace(fit=fit(990.0, mass=5.1, drag=2.1), chosen=chosen, stages=[last])
    )


def test_a_friction_that_explains_more_moves_the_drag_and_the_mass():
    more = fit(1000.0 - LEAST_GAIN, mass=4.8, drag=1.5, friction=0.3)
    diagnosis = diagnosed(more)
    assert _shifts_beside(diagnosis, diagnosis.selection.fit, DRAG) == pytest.approx([0.0, -0.5])
    assert _shifts_beside(diagnosis, diagnosis.selection.fit, MASS) == pytest.approx([0.0, -0.2])


def test_what_explains_hardly_more_moves_nothing():
    less = fit(1001.0 - LEAST_GAIN, mass=4.8, drag=1.5, friction=0.3)
    diagnosis = diagnosed(less)
    assert _shifts_beside(diagnosis, diagnosis.selection.fit, DRAG) == [0.0]


def test_a_round_beside_other_effects_says_nothing():
    more = fit(0.0, mass=4.8, drag=1.5, friction=0.3)
    for diagnosis in (diagnosed(more, named=("spring",)), diagnosed(more, named=())):
        assert _shifts_beside(diagnosis, diagnosis.selection.fit, DRAG) == [0.0]
    diagnosis = diagnosed(more)
    assert _shifts_beside(diagnosis, fit(990.0, mass=5.1, drag=2.1), DRAG) == [0.0]


KPA = (100.0, 300.0, 700.0)
SENSOR = {"bandwidth_hz": 1000.0, "noise_n": 0.1}
GIVEN = imposed(force_sensor=SENSOR)
TIME = np.arange(0.0, 4.0, 0.02)


def scatter_of_friction(friction, *names):
    """Scatter of the size by trial, of effects fitted to friction (N) that differs by pressure."""
    trials = []
    for seed, (force, kpa) in enumerate(zip(friction, KPA, strict=True)):
        hidden = {"contact_friction": {"force_n": force, "presliding_um": 100.0}}
        commands = {
            "contraction_command": 0.01 * (1.0 - np.cos(np.pi * TIME)),
            "pressure_command": np.full(TIME.size, 1e3 * kpa),
        }
        rig = Plant(imposed(force_sensor=SENSOR, **hidden))
        full = rig.simulate(Trial(TIME, commands), seed=seed)
        trials.append(Trial(TIME, full.commands, {"force": full.measurements["force"]}))
    problem = FitProblem(
        trials, GIVEN, free_parameters(GIVEN), tuple(map(white_noise, sensors.deviations(GIVEN)))
    )
    known = {each.name: each for each in candidate_effects(GIVEN, None, trials)}
    chosen = tuple(known[name] for name in names)
    fit = problem.fit(GIVEN, chosen, {each.name: each.probes[0] for each in chosen})
    assert fit is not None
    return homogeneity_test(problem, fit, chosen, 0)["trial"]


BOTH = ("contact_friction", "pressure_friction")


def test_a_growth_that_saturates_is_a_small_error_of_the_friction():
    assert scatter_of_friction((3.9, 5.4, 7.2), *BOTH) < 0.5 * MOST_SPREAD


def test_a_law_that_misses_how_friction_changes_has_no_one_size():
    falls_and_rises = scatter_of_friction((7.0, 3.0, 7.0), *BOTH)
    assert falls_and_rises > 2.0 * MOST_SPREAD
    assert scatter_of_friction((3.9, 5.4, 7.2), "contact_friction") == pytest.approx(0.25, abs=0.08)
