from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pma_gym.data.trial import Trial
from pma_gym.discovery import diagnose
from pma_gym.discovery.experiments.detectability import chance_to_show, experiment_to_detect
from pma_gym.discovery.experiments.excitation import is_safe, library
from pma_gym.discovery.experiments.next_experiment import Discrimination, next_experiment
from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.free_parameters import FreeParameters, prior
from pma_gym.discovery.preparation.noise import white_noise
from pma_gym.discovery.screening.candidates import candidate_effects
from pma_gym.discovery.screening.probe_scores import Baseline
from pma_gym.discovery.screening.score_test import SHOWN_GAIN, screen
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


def test_it_tells_more_a_minute_than_most_of_the_library():
    _, on, rivals, proposal = case("hysteresis")
    discrimination = Discrimination.of(on, rivals, 0)
    hopes = {
        each.name: float(np.min(discrimination.odds([each], discrimination.pairs()))) / each.minutes
        for each in library([*discrimination.models, on.given], 0)
    }
    assert proposal is not None
    others = [rate for name, rate in hopes.items() if name != proposal.excitation]
    assert hopes[proposal.excitation] > np.median(others)


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


def test_effects_that_were_hidden_are_made_to_show():
    _, on, _, _ = case("hysteresis")
    fit = on.fit(station())
    assert fit is not None
    wanted = [every()[name] for name in ("hysteresis", "creep", "drive_saturation")]
    baseline = Baseline.at(on.whitened_residuals(fit.model), fit.values, fit.steps)
    scores = screen(baseline, wanted, 0, lambda candidate: on.probed(fit.model, candidate))
    hidden = [each.candidate.name for each in scores if (each.resolvable or np.inf) > 1.0]
    assert "creep" in hidden
    proposal = experiment_to_detect(on, fit, wanted, scores)
    assert proposal is not None and "creep" in proposal.separates
    assert set(proposal.separates) <= set(hidden)
    assert proposal.expected_odds >= np.exp(12.5)
    assert experiment_to_detect(on, fit, wanted, []) is None


def test_the_chance_to_show_counts_sizes_in_proportion():
    """A tenth of the usual size shows with a hundredth of the gain; a third lies half way."""
    gains = SHOWN_GAIN * np.array([0.0, 1.0, 10.0, 100.0, 1e6])
    assert chance_to_show(gains) == pytest.approx([0.0, 0.0, 0.5, 1.0, 1.0])


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
