"""What a contact deflects before it slips differs by powers of ten; the trials say which it is."""

import numpy as np
import pytest

from pma_gym import Plant
from pma_gym.data.datasets.dataset import NamedTrial
from pma_gym.data.trial import Trial
from pma_gym.discovery.fitting.fit_problem import FitProblem
from pma_gym.discovery.fitting.free_parameters import free_parameters, values
from pma_gym.discovery.fitting.journal import Journal
from pma_gym.discovery.preparation.noise import white_noise
from pma_gym.discovery.preparation.prepared_trials import prepared
from pma_gym.discovery.screening.candidates import candidate_effects
from pma_gym.discovery.selection import scanned_parameters
from pma_gym.discovery.selection.scanned_parameters import with_scanned
from pma_gym.effects import CATALOGUE
from pma_gym.plant.model import Model

PRESLIDING = "joint_friction.presliding_deg"
NOISE = np.radians(0.02)


def torsion_pendulum(**tables):
    """A torque on a joint with a spring and an encoder."""
    given = {
        "torque_drive": {"gain": 1.0},
        "joint_damping": {"coefficient_n_m_s": 7.0},
        "joint_spring": {"stiffness_n_m_per_rad": 3700.0, "rest_deg": 0.0},
        **tables,
        "inertia": {"inertia_kg_m2": 2.1},
        "joint_start": {"angle_deg": 0.0, "spin_deg_per_s": 0.0},
        "encoder": {"bandwidth_hz": 2000.0, "noise_deg": float(np.degrees(NOISE))},
    }
    return Model("arm", "An arm", "joint", {n: CATALOGUE[n].parse(t) for n, t in given.items()})


def trials():
    """Trials that begin at rest, of a contact that deflects a thousandth of what is usual."""
    dry = {"static_n_m": 7.0, "dynamic_n_m": 5.0, "stribeck_speed_deg_per_s": 3.0}
    plant = Plant(torsion_pendulum(joint_friction={**dry, "presliding_deg": 2e-5}))
    time = np.arange(0.0, 3.0, 0.005)
    for seed, hertz in enumerate((0.6, 2.0, 3.6)):
        torque = 60.0 * np.sin(2.0 * np.pi * hertz * np.maximum(time - 0.4, 0.0))
        read = plant.simulate(Trial(time, {"torque_command": torque}), seed=seed)
        yield Trial(time, read.commands, {"angle": read.measurements["angle"]})


@pytest.fixture(scope="module")
def stiff_contact():
    """A problem, its only effect and its fit, where the contact is stiffer than usual."""
    model = torsion_pendulum()
    named, _ = prepared([NamedTrial(f"{k}", trial) for k, trial in enumerate(trials())], model)
    problem = FitProblem(
        [each.trial for each in named], model, free_parameters(model), (white_noise(NOISE),) * 2
    )
    dry = next(each for each in candidate_effects(model) if each.name == "joint_friction")
    fit = problem.fit(model, (dry,), {dry.name: np.array([6.0, 5.0, 3.0])})
    assert fit is not None
    return problem, dry, fit


def test_a_contact_stiffer_than_usual_is_found_by_a_ladder(stiff_contact):
    problem, dry, fit = stiff_contact
    assert values(fit.model, [PRESLIDING])[0] > 1e-4 and problem.left(fit) > 1.3
    (moved,), best = with_scanned(problem, fit, (dry,), Journal(None, [], problem.given, ""))
    assert values(best.model, [PRESLIDING])[0] < 1e-4
    assert problem.left(best) < 1.1
    assert best.estimate("joint_friction.dynamic_n_m")[0] == pytest.approx(5.0, rel=0.05)
    # A fit that begins without the effect gets the same contact.
    assert values(moved.beside(problem.given), [PRESLIDING])[0] == values(best.model, [PRESLIDING])


def test_no_contact_is_tried_that_rings_faster_than_any_reading_shows(stiff_contact, monkeypatch):
    problem, dry, fit = stiff_contact
    here = problem.steps_a_row(fit.model, (dry,))
    stiffer = fit.model.replace({PRESLIDING: 0.1 * values(fit.model, [PRESLIDING])[0]})
    assert 0.0 < here < problem.steps_a_row(stiffer, (dry,))
    monkeypatch.setattr(scanned_parameters, "MOST_STEPS", here)
    _, best = with_scanned(problem, fit, (dry,), Journal(None, [], problem.given, ""))
    assert values(best.model, [PRESLIDING])[0] >= values(fit.model, [PRESLIDING])[0]


def test_what_is_scanned_is_held():
    for effect in CATALOGUE.values():
        assert set(effect.scanned) <= set(effect.held)
