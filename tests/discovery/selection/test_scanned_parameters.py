"""What a contact deflects before it slips differs by powers of ten; the trials say which it is.

A limit that is never reached, and a law whose chi-square is rugged, are fitted all the same.
"""

import numpy as np
import pytest

from pma_gym import Plant
from pma_gym.data.datasets.dataset import NamedTrial
from pma_gym.data.trial import Trial
from pma_gym.discovery import diagnose
from pma_gym.discovery.fitting.fit_problem import FitProblem
from pma_gym.discovery.fitting.free_parameters import at_limit, free_parameters, values
from pma_gym.discovery.fitting.journal import Journal
from pma_gym.discovery.preparation.noise import white_noise
from pma_gym.discovery.preparation.prepared_trials import prepared
from pma_gym.discovery.screening.candidates import candidate_effects
from pma_gym.discovery.selection import scanned_parameters
from pma_gym.discovery.selection.scanned_parameters import with_scanned
from pma_gym.effects import CATALOGUE
from pma_gym.plant.model import Model, load_model

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


def test_a_contact_stays_rigid_where_no_rung_explains_more():
    """Friction as the usual rung has it is off by the square root of how far that deflects."""
    tables = {
        "two_way_drive": {"gain_n_per_v": 20.0, "middle_v": 5.0},
        "slide": {"mass_kg": 44.0},
        "symmetric_damping": {"intercept_n_s_per_mm": 0.7, "slope_n_s_per_mm_per_kpa": 0.0},
        "start": {"contraction_mm": 0.0, "velocity_mm_per_s": 0.0},
    }
    model = Model("axis", "", "slide", {n: CATALOGUE[n].parse(t) for n, t in tables.items()})
    shares = {"drive_share_percent": 8.0, "carried_share_percent": 0.0, "presliding_um": 0.00011}
    rubbing = model.with_effects({"load_dependent_friction": shares})
    time, given = np.arange(0.0, 1.0, 0.005), []
    for seed, hertz in enumerate((2.6, 4.1, 1.7, 3.3)):
        load = 60.0 * np.sin(2.0 * np.pi * hertz * time) + 5.0 * np.sin(40.0 * time + seed)
        read = Plant(rubbing).simulate(Trial(time, {"load_command": load}), noise=False)
        noise = 1e-6 * np.random.default_rng(seed).standard_normal(time.size)
        at = read.measurements["contraction"] + noise
        given.append(Trial(time, read.commands, {"contraction": at}))
    problem = FitProblem(given, model, free_parameters(model), (white_noise(1e-6),) * 2)
    (dry,) = (
        each
        for each in candidate_effects(model, None, given)
        if each.name == "load_dependent_friction"
    )
    path = "load_dependent_friction.presliding_um"
    rung = problem.fit(model.with_effects({dry.name: {**shares, "presliding_um": 0.02}}), (dry,))
    assert rung is not None and problem.left(rung) < 1.1
    journal = Journal(None, [], problem.given, "")
    (held,), best = with_scanned(problem, rung, (dry,), journal, ends_rigid=True)
    assert values(best.model, [path])[0] < 0.001
    assert values(held.beside(problem.given), [path]) == values(best.model, [path])
    share = "load_dependent_friction.drive_share_percent"
    value, error = best.estimate(share)
    assert abs(value - 8.0) < 2.0 * error
    assert abs(rung.estimate(share)[0] - 8.0) > 3.0 * error


def _trials(model: Model) -> list[Trial]:
    time = np.arange(0.0, 5.0, 1 / 64)
    trials = []
    for seed, (volts, period) in enumerate(((1.5, 2.0), (2.5, 1.2), (2.0, 3.0)), 1):
        motor = 0.5 * volts * (1.0 - np.cos(2.0 * np.pi * time / period))
        regulator = 5.5 + 2.0 * np.sign(np.sin(2.0 * np.pi * time / (0.7 * period) + 0.3))
        commands = {"motor_voltage": motor, "regulator_voltage": regulator}
        trials.append(Plant(model).simulate(Trial(time, commands), seed=seed))
    return trials


@pytest.mark.campaign
def test_a_limit_that_is_never_reached_is_fitted_from_its_own_size() -> None:
    """The steps of its derivatives come from its value, not from bounds a million times as wide."""
    hidden = {"regulator_rate_limit": {"limit_kpa_per_s": 600.0}}
    rig = load_model("serres2008").with_effects(hidden)
    fitted = diagnose(_trials(rig), "serres2008", propose=False)
    assert fitted.verdict == "effect"
    (effect,) = fitted.effects
    assert effect.name == "regulator_rate_limit"
    limit = effect.parameters["limit_kpa_per_s"]
    assert limit.value == pytest.approx(600.0, rel=0.02)
    assert limit.limit == ""
    assert not fitted.unfitted


def test_a_boundless_range_has_a_lower_end_only_where_it_begins() -> None:
    """A value far above the lower end is not there because the upper end is farther."""
    assert at_limit(638.0, 10.0, 1e9) == ""
    assert at_limit(10.0, 10.0, 1e9) == "lower"
    assert at_limit(1e9, 10.0, 1e9) == "upper"
