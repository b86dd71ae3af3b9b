"""Terms of one law: each is added by what it explains itself, and leaves where it explains nothing.

A seal rubs without pressure and more with it; a gear by the force of its drive, and perhaps by what
it carries.
"""

from dataclasses import replace

import numpy as np
import pytest

from pma_gym import Plant
from pma_gym.data.trial import Trial
from pma_gym.discovery import diagnose
from pma_gym.discovery.fitting.fit_problem import FitProblem
from pma_gym.discovery.fitting.free_parameters import free_parameters
from pma_gym.discovery.fitting.journal import Journal
from pma_gym.discovery.preparation.noise import white_noise
from pma_gym.discovery.screening.candidates import candidate_effects
from pma_gym.discovery.selection import candidate_fits
from pma_gym.discovery.selection.candidate_fits import without_idle
from pma_gym.discovery.selection.nested_laws import nested
from pma_gym.effects import CATALOGUE
from pma_gym.effects.effect import Effect
from tests.discovery.selection.test_unscored_fits import GIVEN, NOISE_RAD, RATE_HZ, joint
from tests.discovery.test_imposed_motion import KNOWN, sizes_of, trials

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
