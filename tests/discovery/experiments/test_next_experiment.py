from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pma_gym.data.trial import Trial
from pma_gym.discovery import diagnose
from pma_gym.discovery.experiments.excitation import is_safe, library
from pma_gym.discovery.experiments.next_experiment import next_experiment
from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.free_parameters import FreeParameters, prior
from pma_gym.discovery.preparation.noise import white_noise
from pma_gym.discovery.screening.candidates import candidate_effects
from pma_gym.plant import sensors
from pma_gym.plant.model import Model, load_model
from pma_gym.plant.plant import Plant

FREE = (
    "contractile_force.slope_n_per_kpa",
    "contractile_force.intercept_n",
    "damping.contracting_n_s_per_mm",
    "drive.gain_n_per_v",
)


NOISY = {
    "lvdt.noise_mm": 1.2,
    "load_cell.noise_n": 30.0,
    "potentiometer.noise_deg": 6.0,
    "pressure_transducer.noise_kpa": 18.0,
}
"""So noisy that a question stays open until a proper experiment is run."""

TRUTHS = {
    "hysteresis": {"force_n": 20.0, "distance_mm": 1.5},
    "creep": {"stiffness_n_per_mm": 1.5, "time_constant_s": 2.0},
}


def station() -> Model:
    model = load_model("serres2008").replace(NOISY)
    # Without dry friction, whose fits take several times as long.
    smooth = {k: v for k, v in model.parameters.items() if k != "coulomb_friction"}
    return Model(model.name, model.title, model.plant, smooth, model.notes)


def nearly_constant(model: Model) -> list[Trial]:
    """Two trials in which the load moves once, and little."""
    time = np.arange(8 * 128 + 1) / 128
    plant, simulated = Plant(model), []
    for number, pressure in enumerate((280e3, 400e3)):
        motor = 3.0 + 0.3 * np.clip(np.minimum(time - 1.0, 4.0 - time) / 0.5, 0.0, 1.0)
        regulator = np.full(len(time), plant.regulator_voltage(pressure))
        trial = Trial(time, {"motor_voltage": motor, "regulator_voltage": regulator})
        simulated.append(plant.simulate(trial, seed=number))
    return simulated


def fit_problem(trials: list[Trial]) -> FitProblem:
    model = station()
    own = FreeParameters(FREE, np.array([prior(model, path) for path in FREE]))
    noise = tuple(white_noise(float(each)) for each in sensors.noise_levels(model))
    return FitProblem(trials, model, own, noise)


@cache
def every() -> dict[str, CandidateEffect]:
    return {each.name: each for each in candidate_effects(station())}


def fitted(on: FitProblem, name: str) -> Fitted:
    candidate = every()[name]
    usual = candidate.probes[len(candidate.probes) // 2]
    fitted = on.fit(station(), [candidate], {name: usual})
    assert fitted is not None
    return fitted


@cache
def case(true: str):
    truth = station().with_effects({true: TRUTHS[true]})
    on = fit_problem(nearly_constant(truth))
    rivals = [(fitted(on, name), (every()[name],)) for name in TRUTHS]
    return truth, on, rivals, next_experiment(on, rivals, 0)


def lead(on: FitProblem, name: str) -> float:
    """Log-likelihood of the true one beyond the other's, both fitted to all trials."""
    other = next(each for each in TRUTHS if each != name)
    return 0.5 * (fitted(on, other).chi_square - fitted(on, name).chi_square)


@pytest.mark.parametrize("true", ["hysteresis", pytest.param("creep", marks=pytest.mark.campaign)])
def test_proposed_trial_tells_what_was_promised(true):
    truth, on, rivals, proposal = case(true)
    assert proposal is not None and proposal.separates == tuple(TRUTHS)
    measured = Plant(truth).simulate(proposal.trial, seed=7)
    before, after = lead(on, true), lead(replace(on, trials=[*on.trials, measured]), true)
    assert after - before >= 0.5 * np.log(proposal.expected_odds)
    assert proposal.minutes == pytest.approx(proposal.trial.duration / 60.0)


def test_the_same_seed_proposes_the_same_trial():
    """It is commands and nothing else; one rival needs no experiment."""
    _, on, rivals, proposal = case("hysteresis")
    again = next_experiment(on, rivals, 0)
    assert proposal is not None and again is not None
    assert (again.excitation, again.expected_odds) == (proposal.excitation, proposal.expected_odds)
    assert set(again.trial.commands) == {"motor_voltage", "regulator_voltage"}
    for name, volts in again.trial.commands.items():
        np.testing.assert_array_equal(volts, proposal.trial.commands[name])
    assert not proposal.trial.measurements and not proposal.trial.truth
    assert next_experiment(on, rivals[:1], 0) is None


def test_one_effect_is_asked_about_against_nothing():
    _, on, rivals, _ = case("hysteresis")
    plain = on.fit(station())
    assert plain is not None
    proposal = next_experiment(on, [rivals[0], (plain, ())], 0)
    assert proposal is not None and proposal.separates == (rivals[0][0].names[0],)
    assert proposal.expected_odds > 20.0


def test_every_excitation_is_safe_and_as_long_as_a_test_may_be():
    model = station()
    excitations = list(library([model]))
    assert len(excitations) == 30 and len({each.name for each in excitations}) == 30
    for each in excitations:
        again = Plant(model).simulate(each.trial, noise=False)
        assert is_safe(model, again), each.name
        assert 10.0 <= each.trial.duration <= 60.0
        np.testing.assert_allclose(np.diff(each.trial.time), 1.0 / 128.0)


def test_a_rig_of_narrow_limits_gets_smaller_loads():
    narrow = station().replace({"limits.tension_n": 700.0, "limits.contraction_mm": 50.0})
    wide, few = list(library([station()])), list(library([narrow]))
    assert 0 < len(few) < len(wide)
    for each in few:
        assert np.max(each.simulated[0].truth["load"]) <= 0.9 * 700.0
        assert np.max(each.simulated[0].truth["contraction"]) <= 0.9 * 50e-3


@pytest.mark.campaign
def test_who_knows_nothing_is_proposed_what_moves_load_and_pressure():
    """Of a trial at rest nearly everything is hidden: moving one of both shows less."""
    time = np.arange(0.0, 4.0, 1.0 / 64.0)
    still = Trial(time, {"motor_voltage": 0 * time + 3.0, "regulator_voltage": 0 * time + 6.0})
    measured = Plant(station()).simulate(still, seed=3)
    diagnosis = diagnose([measured], station())
    assert diagnosis.next_experiment is not None
    volts = diagnosis.next_experiment.trial.commands
    assert min(np.ptp(volts["motor_voltage"]), np.ptp(volts["regulator_voltage"])) > 1.0
