"""Far from the trials a score tells little: what it overlooks is fitted all the same."""

from dataclasses import replace

import numpy as np
import pytest

from pma_gym import Plant
from pma_gym.data.trial import Trial
from pma_gym.discovery.fitting.fit_problem import FitProblem
from pma_gym.discovery.fitting.free_parameters import free_parameters
from pma_gym.discovery.fitting.journal import Journal
from pma_gym.discovery.preparation.noise import white_noise
from pma_gym.discovery.screening.candidates import candidate_effects
from pma_gym.discovery.screening.probe_scores import Baseline
from pma_gym.discovery.screening.score_test import ScreeningScore
from pma_gym.discovery.selection.unscored_fits import unscored_fits
from pma_gym.effects import CATALOGUE
from pma_gym.plant.model import Model

NOISE_RAD, SHARE_PERCENT, RATE_HZ = 1e-4, 30.0, 100.0
GIVEN = {
    "dc_motor": {"torque_constant_n_m_per_a": 0.4, "resistance_ohm": 4.0},
    "joint_weight": {"moment_n_m": 0.4, "offset_deg": 0.0},
    "inertia": {"inertia_kg_m2": 0.006},
    "joint_start": {"angle_deg": 0.0, "spin_deg_per_s": 0.0},
}
HIDDEN = {
    "drive_share_percent": SHARE_PERCENT,
    "carried_share_percent": SHARE_PERCENT,
    "presliding_deg": 0.02,
}


def joint(tables):
    """A pendulum that a DC motor swings."""
    return Model("arm", "An arm", "joint", {n: CATALOGUE[n].parse(t) for n, t in tables.items()})


@pytest.fixture(scope="module")
def far_away():
    """Trials of a pendulum with friction by load, and the refit of a model without it."""
    generator, time = np.random.default_rng(1), np.arange(0.0, 1.0, 1.0 / RATE_HZ)
    plant, trials = Plant(joint(GIVEN | {"joint_load_friction": HIDDEN})), []
    for hertz in (0.7, 1.1, 1.6):
        volts = 5.0 * np.sin(2.0 * np.pi * hertz * time)
        asked = Trial(time, {"winding_voltage": volts})
        exact = plant.simulate(asked, noise=False).measurements["angle"]
        noisy = exact + NOISE_RAD * generator.standard_normal(time.size)
        trials.append(replace(asked, measurements={"angle": noisy}))
    model = joint(GIVEN)
    own = free_parameters(model)
    # A joint's outputs are its angle and its speed.
    noise = tuple(white_noise(NOISE_RAD) for _ in model.rig.signals)
    problem = FitProblem(trials, model, own, noise)
    before = problem.fit(model)
    assert before is not None and problem.left(before) > 10.0
    candidates = candidate_effects(model, None, trials)
    (friction,) = [each for each in candidates if each.name == "joint_load_friction"]
    none = ScreeningScore(friction, 0.0, 1.0, -1, 0.0, 0.0, None, ())
    baseline = Baseline.at(problem.whitened_residuals(before.model), before.values, before.steps)
    return problem, baseline, before, none


def fits_beside(far_away, others):
    problem, baseline, before, none = far_away
    journal = Journal(None, problem.trials, problem.given, "")
    return unscored_fits(problem, baseline, before, (), [none], others, journal, lambda *_: None)


def test_what_has_no_score_is_fitted_where_nothing_else_comes_near(far_away):
    fit = fits_beside(far_away, {})["joint_load_friction"]
    assert far_away[0].left(fit) < 1.5
    for share in ("drive_share_percent", "carried_share_percent"):
        assert fit.estimate(f"joint_load_friction.{share}")[0] == pytest.approx(
            SHARE_PERCENT, rel=0.05
        )


def test_it_is_not_where_a_fit_explains_the_larger_part(far_away):
    before = far_away[2]
    better = replace(before, chi_square=0.4 * before.chi_square)
    assert fits_beside(far_away, {"joint_drag": better}) == {}
