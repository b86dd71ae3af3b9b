"""Selection: what is hidden is found, what is not is not, and what is chosen fits."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pma_gym.data.trial import Trial
from pma_gym.discovery.fitting.fit_problem import FitProblem
from pma_gym.discovery.fitting.free_parameters import free_parameters, values
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


def test_hysteresis_is_found_with_its_size_and_parameters_come_right_beside_it():
    _, refitted, stage = selected("hysteresis")
    assert [candidate.name for candidate in stage.chosen] == ["hysteresis"]
    sizes = {"hysteresis.force_n": 6.0, "hysteresis.distance_mm": 1.0}
    for path, truth in (sizes | OFF).items():
        value, error = stage.fit.estimate(path)
        assert abs(value - truth) < 3.5 * error and (path in OFF or error < 0.1 * truth)
    assert stage.fit.chi_square < 0.7 * refitted.chi_square
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
    (first,) = stage.stages
    assert stage.chosen == first.gate == () and first.fits == {}
    expected = shared.whitened_residuals(refitted.model).count
    assert abs(refitted.chi_square - expected) < 5 * np.sqrt(2 * expected)


def test_the_chosen_lead_their_rounds():
    _, _, stage = selected("hysteresis")
    first, second = stage.stages
    assert all(passes(first.problem, each, first.missing) for each in first.gate)
    assert first.missing or all(each.p_value <= ALARM for each in first.gate)
    assert "hysteresis" in {each.candidate.name for each in first.gate}
    assert min(first.fits, key=lambda name: cost(first.fits[name])) == "hysteresis"
    gains = [each.gain for each in first.scores]
    assert gains == sorted(gains, reverse=True)
    for name, fit in first.fits.items():
        assert fit.chi_square <= first.before.chi_square, name
        assert fit.names == (name,) and set(first.before.paths) < set(fit.paths)
    # What was added is not looked for again.
    assert "hysteresis" not in {each.candidate.name for each in second.scores}


@pytest.mark.parametrize("case", ["hysteresis", "nothing"])
def test_learnt_noise_is_never_less_than_at_rest(case):
    shared, _, stage = selected(case)
    for before, after in zip(shared.noise, stage.problem.noise, strict=True):
        assert before.level <= after.level < 1.15 * before.level


def test_a_fit_comes_back_from_its_journal_bit_by_bit():
    """A delay comes back switched on."""
    shared, refitted, stage = selected("hysteresis")
    delay = next(each for each in CANDIDATES if each.name == "regulator_delay")
    late = shared.fit(refitted.model, (delay,), {delay.name: delay.probes[0]})
    first = stage.stages[0]
    for fit, before, chosen in (
        (first.fits["hysteresis"], first.before, stage.chosen),
        (late, refitted, (delay,)),
    ):
        again = restored(kept_form(fit), shared, before, chosen)
        assert (again.paths, again.names, again.model) == (fit.paths, fit.names, fit.model)
        assert np.array_equal(again.values, fit.values) and again.chi_square == fit.chi_square
    assert again.model.values_in_files("regulator_delay")["share"] == 1.0


def test_the_truth_is_hardly_better_than_what_was_found():
    """The search found the bottom: no model explains much more than the one that made the data."""
    shared, _, stage = selected("hysteresis")
    truth = STATION.replace(OFF).with_effects(HYSTERESIS)
    whitened = shared.whitened_residuals(truth, stage.chosen)
    begun = values(truth, [each.path for each in whitened.free])
    there = whitened.sums(begun, np.empty(0)).chi_square
    assert stage.stages[0].fits["hysteresis"].chi_square < there + 10.0


def taut(effects, rate=128.0):
    """Trials of which one begins with a slack cable that comes taut once, slowly drawn."""
    simulated, plant = [], Plant(STATION.with_effects(effects).replace(OFF))
    for number, asked in enumerate(commanded(3, rate)):
        commands = {name: np.array(row) for name, row in asked.commands.items()}
        if number == 0:
            commands["motor_voltage"] = np.interp(asked.time, [0.5, 2.0, 4.5], [0.0, 2.0, 0.5])
            commands["regulator_voltage"] += 1.0 * (asked.time < 0.5)
        simulated.append(plant.simulate(Trial(asked.time, commands), seed=7 + number, noise=True))
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


@pytest.mark.campaign
def test_a_beat_of_the_cable_opens_the_gate_for_what_makes_it(monkeypatch):
    trials = taut({"drive_dead_zone": {"width_n": 5.0, "slope": 2.0}})
    scan, selection = by_bursts_alone(trials, monkeypatch)
    assert scan.chance < 1e-6 and scan.excess > 300.0
    assert [candidate.name for candidate in selection.chosen] == ["drive_dead_zone"]
    assert selection.stages[0].scores[0].p_value <= scan.chance
    assert selection.stages[0].scan == scan and selection.stages[1].scan.excess == 0.0
    assert selection.fit.estimate("drive_dead_zone.width_n")[0] == pytest.approx(5.0, rel=0.15)
    assert selection.fit.chi_square < 1.05 * fit_problem(trials).whitened_residuals(STATION).count


def test_a_cable_that_comes_taut_as_it_should_is_no_burst(monkeypatch):
    scan, selection = by_bursts_alone(taut({}), monkeypatch)
    assert scan.chance == 1.0 and scan.excess == 0.0
    assert selection.chosen == () and selection.stages[0].gate == ()


@pytest.mark.campaign
def test_noise_larger_in_places_bursts_but_names_nothing(monkeypatch):
    trials, generator = taut({}), np.random.default_rng(0)
    for k, trial in enumerate(trials):
        load = np.array(trial.measurements["load"])
        load[200:264] += 3.0 * generator.standard_normal(64)
        trials[k] = replace(trial, measurements={**trial.measurements, "load": load})
    scan, selection = by_bursts_alone(trials, monkeypatch)
    (first, *_) = selection.stages
    assert scan.excess > 300.0
    assert selection.chosen == first.gate == () and first.fits == {}
    assert all(each.p_value > 1e-3 for each in first.scores)


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
