"""Far from the trials a score tells little: what it overlooks is fitted all the same.

What is added first may stand for something else until the second effect is there.

Terms of one law: each is added by what it explains itself, and leaves where it explains nothing.

A seal rubs without pressure and more with it; a gear by the force of its drive, and perhaps by what
it carries.

Candidates that could not be fitted are listed; those whose score promised too much are not.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pma_gym import Plant
from pma_gym.data.datasets.dataset import NamedTrial
from pma_gym.data.trial import Trial
from pma_gym.discovery import diagnose
from pma_gym.discovery.fitting.fit_problem import FitProblem
from pma_gym.discovery.fitting.free_parameters import free_parameters
from pma_gym.discovery.fitting.journal import Journal
from pma_gym.discovery.preparation.noise import white_noise
from pma_gym.discovery.preparation.prepared_trials import prepared
from pma_gym.discovery.screening.candidates import candidate_effects
from pma_gym.discovery.screening.probe_scores import Baseline
from pma_gym.discovery.screening.score_test import ScreeningScore, screen
from pma_gym.discovery.selection import candidate_fits
from pma_gym.discovery.selection.candidate_fits import (
    carries_the_rest,
    stripped,
    unfitted,
    without_idle,
)
from pma_gym.discovery.selection.exchanged_effects import exchanged
from pma_gym.discovery.selection.nested_laws import nested
from pma_gym.discovery.selection.unscored_fits import unscored_fits
from pma_gym.effects import CATALOGUE
from pma_gym.effects.effect import Effect
from pma_gym.plant.model import Model
from tests.discovery.laboratory import STATION, fit_problem, laboratory
from tests.discovery.test_imposed_motion import KNOWN, sizes_of, trials

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


NOISE = np.radians(0.02)


def wheel(**tables):
    """A torque on a damped joint with an encoder."""
    given = {
        "torque_drive": {"gain": 1.0},
        "joint_damping": {"coefficient_n_m_s": 2.0},
        **tables,
        "inertia": {"inertia_kg_m2": 1.4},
        "joint_start": {"angle_deg": 0.0, "spin_deg_per_s": 0.0},
        "encoder": {"bandwidth_hz": 2000.0, "noise_deg": float(np.degrees(NOISE))},
    }
    return Model("arm", "An arm", "joint", {n: CATALOGUE[n].parse(t) for n, t in given.items()})


@pytest.fixture(scope="module")
def problem():
    rig = wheel(
        joint_hardening_spring={"cubic_n_m_per_rad3": 8.0},
        joint_directional_damping={"difference_n_m_s": 1.0},
    )
    time, trials = np.arange(0.0, 4.0, 0.01), []
    for seed, hertz in enumerate((0.7, 1.1)):
        torque = 25.0 * np.sin(2.0 * np.pi * hertz * time)
        read = Plant(rig).simulate(Trial(time, {"torque_command": torque}), seed=seed)
        trials.append(Trial(time, read.commands, {"angle": read.measurements["angle"]}))
    model = wheel()
    named, _ = prepared([NamedTrial(f"{k}", each) for k, each in enumerate(trials)], model)
    pieces = [each.trial for each in named]
    return FitProblem(pieces, model, free_parameters(model), (white_noise(NOISE),) * 2)


def test_a_spring_gives_way_to_the_hardening_spring_that_it_stood_for(problem):
    known = {each.name: each for each in candidate_effects(problem.given, None, problem.trials)}
    spring, hard, damping = (
        known[name]
        for name in ("joint_spring", "joint_hardening_spring", "joint_directional_damping")
    )
    fits = {
        each.name: problem.fit(problem.given, (each,), {each.name: each.probes[0]})
        for each in (spring, hard)
    }
    chosen = (spring, damping)
    starts = {each.name: each.probes[0] for each in chosen}
    fit = problem.fit(problem.given, chosen, starts)
    assert problem.left(fit) > 1.2
    alone = problem.fit(problem.given)
    beside = list(known.values())
    after, best = exchanged(problem, fit, chosen, [(alone, fits), (alone, {})], beside, [0])
    assert [each.name for each in after] == ["joint_hardening_spring", "joint_directional_damping"]
    assert problem.left(best) < 1.1
    cubic, _ = best.estimate("joint_hardening_spring.cubic_n_m_per_rad3")
    assert cubic == pytest.approx(8.0, rel=0.05)
    # What explains most already stays.
    again, same = exchanged(problem, best, after, [(alone, fits), (alone, {})], beside, [0])
    assert again == after and same is best


@pytest.mark.parametrize(
    ("left", "gain", "carries"),
    [(5.0, 2000.0, True), (5.0, 1500.0, False), (1.2, 40.0, True), (1.04, 8.0, False)],
)
def test_a_second_effect_counts_that_carries_nearly_all_of_much(left, gain, carries):
    before = SimpleNamespace(chi_square=100 * left**2)
    problem = SimpleNamespace(count=100, left=lambda fit: (fit.chi_square / 100) ** 0.5)
    assert carries_the_rest(problem, before, gain) is carries


SEAL = ("pressure_friction", "contact_friction")


def test_friction_by_pressure_is_a_term_of_the_friction_of_a_rod_alone():
    pairs = [
        {one.name, other.name}
        for one in CATALOGUE.values()
        for other in CATALOGUE.values()
        if one.is_further_term(other)
    ]
    assert pairs == [set(SEAL)] * 2


def test_friction_without_pressure_stays_however_small_beside_the_whole_gain(monkeypatch):
    """It explains less than a fiftieth of what both do, as an error of another law would."""
    hidden = {
        "pressure_friction": {"slope_n_per_kpa": 0.2, "presliding_um": 100.0},
        "contact_friction": {"force_n": 3.0, "presliding_um": 100.0},
    }
    logs = trials((300e3, 400e3), (0.02, 0.02), **hidden)
    problem = FitProblem(logs, KNOWN, free_parameters(KNOWN), (white_noise(0.3),) * 3)
    by_name = {each.name: each for each in candidate_effects(KNOWN)}
    chosen = tuple(by_name[name] for name in SEAL)
    starts = {"pressure_friction": [0.19, 90.0], "contact_friction": [4.0, 90.0, 0.5, 5.0]}
    begun = {name: np.array(each) for name, each in starts.items()}
    both, refitted = problem.fit(KNOWN, chosen, begun), problem.fit(KNOWN)
    alone = problem.fit(KNOWN, chosen[:1], {SEAL[0]: begun[SEAL[0]]})
    assert both is not None and refitted is not None and alone is not None
    missed = alone.chi_square - both.chi_square
    assert 300.0 < missed < 0.02 * (refitted.chi_square - both.chi_square)
    # As where other things are left, too: what carries most of the rest stays anyway.
    monkeypatch.setattr(candidate_fits, "carries_the_rest", lambda *_: False)
    journal = Journal(None, logs, KNOWN, "")
    assert without_idle(problem, both, chosen, refitted, journal)[0] == chosen
    monkeypatch.setattr(Effect, "is_further_term", lambda *_: False)
    assert without_idle(problem, both, chosen, refitted, journal)[0] != chosen


@pytest.mark.parametrize(("carried", "left"), [(0.0, True), (30.0, False)])
def test_friction_by_load_has_a_share_of_what_is_carried_only_where_it_shows(carried, left):
    shares = {"drive_share_percent": 30.0, "carried_share_percent": carried}
    truth = joint(GIVEN | {"joint_load_friction": shares | {"presliding_deg": 0.02}})
    model = joint(GIVEN)
    time, generator, logs = np.arange(0.0, 1.0, 1.0 / RATE_HZ), np.random.default_rng(3), []
    for hertz in (0.7, 1.1, 1.6):
        asked = Trial(time, {"winding_voltage": 5.0 * np.sin(2.0 * np.pi * hertz * time)})
        exact = Plant(truth).simulate(asked, noise=False).measurements["angle"]
        noisy = exact + NOISE_RAD * generator.standard_normal(time.size)
        logs.append(replace(asked, measurements={"angle": noisy}))
    noise = (white_noise(NOISE_RAD),) * len(model.rig.signals)
    problem = FitProblem(logs, model, free_parameters(model), noise)
    friction = next(
        e for e in candidate_effects(model, None, logs) if e.name == "joint_load_friction"
    )
    fit = problem.fit(model, (friction,), {friction.name: np.array([28.0, 5.0])})
    assert fit is not None
    less = nested(problem, fit, (friction,))
    assert (set(less.undetermined) == {"joint_load_friction.carried_share_percent"}) is left
    share = less.fit.estimate("joint_load_friction.drive_share_percent")[0]
    assert share == pytest.approx(30.0, rel=0.02)


@pytest.mark.parametrize(
    ("force", "slope"),
    [
        pytest.param(0.5, 3e-3, marks=pytest.mark.campaign),
        pytest.param(1.0, 2e-3, marks=pytest.mark.campaign),
        pytest.param(1.0, 0.0, marks=pytest.mark.campaign),
        (0.0, 3e-3),
    ],
)
def test_friction_of_a_seal_has_both_parts_where_both_are_there_and_one_where_one_is(force, slope):
    """Each changes less beside the other than is looked for by itself."""
    hidden = {
        "contact_friction": {"force_n": force, "presliding_um": 100.0},
        "pressure_friction": {"slope_n_per_kpa": slope, "presliding_um": 100.0},
    }
    given = trials((250e3, 300e3, 350e3, 400e3), (0.02,) * 4, **hidden)
    diagnosis = diagnose(given, KNOWN, propose=False)
    sizes = sizes_of(diagnosis)
    there = {"contact_friction.force_n": force, "pressure_friction.slope_n_per_kpa": slope}
    there = {path: size for path, size in there.items() if size}
    named = {path for path in sizes if not path.endswith("presliding_um")}
    assert named == set(there), diagnosis.sentence
    for path, size in there.items():
        assert sizes[path] == pytest.approx(size, rel=0.03)


THERE, OTHER = "hysteresis", "load_cell_error"


@pytest.fixture(scope="module")
def scored():
    problem = fit_problem(laboratory("hysteresis")[0])
    before = problem.careful_fit(STATION)
    assert before is not None
    whitened = problem.whitened_residuals(before.model)
    baseline = Baseline.at(whitened, before.values, before.steps)
    candidates = [each for each in candidate_effects(STATION) if each.name in (THERE, OTHER)]
    plain = stripped(problem, before)
    scores = screen(baseline, candidates, 0, lambda each: problem.probed(plain, each))
    return problem, baseline, before, {each.candidate.name: each for each in scores}


def test_an_effect_that_is_there_and_has_no_fit_is_listed(scored):
    problem, baseline, before, scores = scored
    assert unfitted(problem, baseline, before, (), [scores[THERE]], {}) == (THERE,)


def test_a_promise_that_no_refit_keeps_lists_nothing(scored):
    """Parameters that follow along straight lines seem to leave a gain; a refit has none."""
    problem, baseline, before, scores = scored
    promised = replace(scores[OTHER], gain=2.0 * scores[THERE].gain)
    assert unfitted(problem, baseline, before, (), [promised], {}) == ()
