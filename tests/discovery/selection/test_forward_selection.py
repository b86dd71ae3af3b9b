"""Selection: what is hidden is found, what is not is not, and what is chosen fits."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pma_gym.data.trial import Trial
from pma_gym.discovery.fitting.fit_problem import FitProblem
from pma_gym.discovery.fitting.free_parameters import free_parameters
from pma_gym.discovery.fitting.journal import Journal
from pma_gym.discovery.preparation.noise import white_noise
from pma_gym.discovery.screening.candidates import candidate_effects
from pma_gym.discovery.screening.residuals import is_autocorrelated, scan_of_fit
from pma_gym.discovery.screening.score_test import ScreeningScore
from pma_gym.discovery.selection import stages
from pma_gym.discovery.selection.candidate_fits import cost, without_absent
from pma_gym.discovery.selection.forward_selection import select
from pma_gym.discovery.selection.kept_fits import kept_form, restored
from pma_gym.discovery.selection.stages import ALARM, passes
from pma_gym.plant.plant import Plant
from tests.discovery.laboratory import HYSTERESIS, OFF, STATION, commanded, fit_problem, laboratory
from tests.discovery.screening.test_usual_sizes import swung
from tests.discovery.test_joint import joint

CANDIDATES = candidate_effects(STATION)


@cache
def selected(case, seed=0):
    trials = laboratory(case)[0]
    shared = fit_problem(trials)
    refitted = shared.careful_fit(STATION)
    assert refitted is not None
    journal = Journal(None, trials, STATION, "")
    return shared, refitted, select(shared, refitted, CANDIDATES, seed, journal, lambda *_: None)


def test_hysteresis_is_found_with_its_size():
    _, refitted, stage = selected("hysteresis")
    assert [candidate.name for candidate in stage.chosen] == ["hysteresis"]
    for path, truth in (("hysteresis.force_n", 6.0), ("hysteresis.distance_mm", 1.0)):
        value, error = stage.fit.estimate(path)
        assert abs(value - truth) < 3.0 * error
        assert error < 0.1 * truth
    assert stage.fit.chi_square < 0.7 * refitted.chi_square


def test_parameters_come_right_only_beside_the_effect():
    _, refitted, stage = selected("hysteresis")
    for path, truth in OFF.items():
        value, error = stage.fit.estimate(path)
        assert abs(value - truth) < 3.5 * error
    # Damping takes what hysteresis loses, as long as that is missing.
    truth = STATION.values_in_files("damping")["contracting_n_s_per_mm"]
    wrong, right = (
        abs(fit.estimate("damping.contracting_n_s_per_mm")[0] - truth)
        for fit in (refitted, stage.fit)
    )
    assert right < 0.5 * wrong


@pytest.mark.parametrize("case", ["nothing", "parameters"])
def test_nothing_hidden_nothing_found(case):
    shared, refitted, stage = selected(case)
    assert stage.chosen == ()
    assert len(stage.stages) == 1
    assert stage.stages[0].gate == () and stage.stages[0].fits == {}
    expected = shared.whitened_residuals(refitted.model).count
    assert abs(refitted.chi_square - expected) < 5 * np.sqrt(2 * expected)


def test_the_chosen_lead_their_rounds():
    _, _, stage = selected("hysteresis")
    first = stage.stages[0]
    assert all(passes(first.problem, each, first.missing) for each in first.gate)
    assert first.missing or all(each.p_value <= ALARM for each in first.gate)
    assert "hysteresis" in {each.candidate.name for each in first.gate}
    assert min(first.fits, key=lambda name: cost(first.fits[name])) == "hysteresis"
    assert [each.gain for each in first.scores] == sorted(
        (each.gain for each in first.scores), reverse=True
    )


def test_every_fit_explains_more_than_without():
    _, _, stage = selected("hysteresis")
    first = stage.stages[0]
    for name, fit in first.fits.items():
        assert fit.chi_square <= first.before.chi_square, name
        assert fit.names == (name,)
        assert set(first.before.paths) < set(fit.paths)


def test_what_was_added_is_not_looked_for_again():
    _, _, stage = selected("hysteresis")
    assert len(stage.stages) == 2
    assert "hysteresis" not in {each.candidate.name for each in stage.stages[1].scores}


def test_learnt_noise_is_never_less_than_at_rest():
    for case in ("hysteresis", "nothing"):
        shared, _, stage = selected(case)
        for before, after in zip(shared.noise, stage.problem.noise, strict=True):
            assert after.level >= before.level
            assert after.level < 1.15 * before.level


def test_a_fit_comes_back_from_its_journal_bit_by_bit():
    shared, _, stage = selected("hysteresis")
    fit = stage.stages[0].fits["hysteresis"]
    again = restored(kept_form(fit), shared, stage.stages[0].before, stage.chosen)
    assert again.paths == fit.paths and again.names == fit.names
    assert np.array_equal(again.values, fit.values)
    assert again.chi_square == fit.chi_square
    for path in fit.paths:
        effect, _, file_key = path.partition(".")
        assert (
            again.model.values_in_files(effect)[file_key]
            == fit.model.values_in_files(effect)[file_key]
        )


def test_a_delay_comes_back_from_its_journal_switched_on():
    shared, refitted, _ = selected("hysteresis")
    delay = next(each for each in CANDIDATES if each.name == "regulator_delay")
    fit = shared.fit(refitted.model, (delay,), {"regulator_delay": delay.probes[0]})
    again = restored(kept_form(fit), shared, refitted, (delay,))
    assert again.model.values_in_files("regulator_delay") == fit.model.values_in_files(
        "regulator_delay"
    )
    assert again.model.values_in_files("regulator_delay")["share"] == 1.0


def test_the_truth_is_hardly_better_than_what_was_found():
    """The search found the bottom: no model explains much more than the one that made the data."""
    shared, _, stage = selected("hysteresis")
    truth = STATION.replace(OFF)
    truth = truth.with_effects(HYSTERESIS)
    whitened = shared.whitened_residuals(truth, stage.chosen)
    begun = np.array([_value(truth, each.path) for each in whitened.free])
    there = whitened.sums(begun, np.empty(0)).chi_square
    fitted = stage.stages[0].fits["hysteresis"]
    assert fitted.chi_square < there + 10.0


def _value(model, path):
    effect, _, file_key = path.partition(".")
    return model.values_in_files(effect)[file_key]


def taut(effects, rate=128.0):
    """Trials of which one begins with a slack cable that comes taut once, slowly drawn."""
    simulated = []
    for number, asked in enumerate(commanded(3, rate)):
        time = asked.time
        motor, regulator = (
            np.array(asked.commands[f"{name}_voltage"]) for name in ("motor", "regulator")
        )
        if number == 0:
            motor = np.interp(time, [0.5, 2.0, 4.5], [0.0, 2.0, 0.5])
            regulator += 1.0 * (time < 0.5)
        commands = {"motor_voltage": motor, "regulator_voltage": regulator}
        plant = Plant(STATION.with_effects(effects).replace(OFF))
        simulated.append(plant.simulate(Trial(time, commands), seed=7 + number, noise=True))
    return simulated


def by_bursts_alone(trials, monkeypatch):
    """A selection for which no score passes the gate."""
    monkeypatch.setattr(stages, "ALARM", -1.0)
    shared = fit_problem(trials)
    refitted = shared.careful_fit(STATION)
    assert not is_autocorrelated(shared, refitted)
    selection = select(
        shared, refitted, CANDIDATES, 0, Journal(None, trials, STATION, ""), lambda *_: None
    )
    return scan_of_fit(shared, refitted), selection


def readings(trials):
    return fit_problem(trials).whitened_residuals(STATION).count


@pytest.mark.campaign
def test_a_beat_of_the_cable_opens_the_gate_for_what_makes_it(monkeypatch):
    trials = taut({"drive_dead_zone": {"width_n": 5.0, "slope": 2.0}})
    scan, selection = by_bursts_alone(trials, monkeypatch)
    assert scan.chance < 1e-6 and scan.excess > 300.0
    assert [candidate.name for candidate in selection.chosen] == ["drive_dead_zone"]
    assert selection.stages[0].scores[0].p_value <= scan.chance
    assert selection.stages[0].scan == scan and selection.stages[1].scan.excess == 0.0
    assert selection.fit.estimate("drive_dead_zone.width_n")[0] == pytest.approx(5.0, rel=0.15)
    assert selection.fit.chi_square < 1.05 * readings(trials)


def test_a_cable_that_comes_taut_as_it_should_is_no_burst(monkeypatch):
    scan, selection = by_bursts_alone(taut({}), monkeypatch)
    assert scan.chance == 1.0 and scan.excess == 0.0
    assert selection.chosen == () and selection.stages[0].gate == ()


@pytest.mark.campaign
def test_noise_larger_in_places_bursts_but_names_nothing(monkeypatch):
    trials, generator = [], np.random.default_rng(0)
    for trial in taut({}):
        row = {name: np.array(values) for name, values in trial.measurements.items()}
        rows = slice(200, 264)
        row["load"][rows] += 3.0 * generator.standard_normal(64)
        trials.append(Trial(trial.time, trial.commands, row))
    scan, selection = by_bursts_alone(trials, monkeypatch)
    assert scan.excess > 300.0
    assert (
        selection.chosen == () and selection.stages[0].gate == () and selection.stages[0].fits == {}
    )
    assert all(each.p_value > 1e-3 for each in selection.stages[0].scores)


@pytest.mark.parametrize(("change", "whole", "pieces"), [(0.3, 1, 1), (0.08, 0, 1), (0.03, 0, 0)])
def test_a_smaller_change_counts_in_pieces_of_one_file_and_beside_a_drift(change, whole, pieces):
    """Each piece has a start of its own, which takes up most of what an effect does."""
    candidate = candidate_effects(STATION)[0]
    score = ScreeningScore(candidate, 99.0, 0.0005, 0, 1.0, change, None, ())
    trials = commanded(2)
    own = free_parameters(STATION)
    problem = FitProblem(trials, STATION, own, (), files=("one", "other"))
    problem = replace(problem, noise=(white_noise(1e-5),) * 4)
    assert passes(problem, score) == bool(whole)
    assert passes(replace(problem, files=("one", "one")), score) == bool(pieces)
    # A drift takes up most of what creep does.
    drifting = (replace(white_noise(1e-5), drift=1e-5, waves=2), *problem.noise[1:])
    assert passes(replace(problem, noise=drifting), score) == bool(pieces)


def test_an_effect_that_ended_at_nothing_is_not_named():
    """A fit may leave the size of an earlier effect at zero once a later one is there."""
    swing = np.linspace(0.0, 2.0, 401)
    torque = 0.5 * np.sin(2.0 * np.pi * swing)
    damped = joint().with_effects({"joint_drag": {"coefficient_n_m_s2": 0.02}})
    trial = Plant(damped).simulate(Trial(swing, {"torque_command": torque}), noise=False)
    trial = Trial(swing, trial.commands, {"angle": trial.measurements["angle"]})
    known = {each.name: each for each in candidate_effects(joint(), None, [trial])}
    chosen = (known["joint_spring"], known["joint_drag"])
    noise = (white_noise(1e-4), white_noise(1.0))
    problem = FitProblem([trial], joint(), free_parameters(joint()), noise)
    fit = problem.fit(joint(), chosen, {"joint_spring": np.array([1e-16, 0.0])})
    assert fit is not None
    at = fit.paths.index("joint_spring.stiffness_n_m_per_rad")
    ended = replace(fit, model=fit.model.replace({fit.paths[at]: 1e-16}))
    assert ended.model.parameters.keys() >= {"joint_spring", "joint_drag"}
    others, left = without_absent(problem, ended, chosen)
    assert [each.name for each in others] == ["joint_drag"]
    assert "joint_spring" not in left.model.parameters and fit.paths[at] not in left.paths
    assert left.estimate("joint_drag.coefficient_n_m_s2")[0] == pytest.approx(0.02, rel=0.01)
    # What has a size stays, and so does a fit in which all have one.
    assert without_absent(problem, left, others) == (others, left)


def test_a_time_at_its_usual_value_is_no_effect_at_nothing():
    trial = swung(0.5, 0.3)
    absent = {
        each.name: each.is_absent(each.model) for each in candidate_effects(joint(), None, [trial])
    }
    times = {"drive_delay", "drive_lag", "encoder_delay", "encoder_lag"}
    assert {name for name, none in absent.items() if not none} == times
