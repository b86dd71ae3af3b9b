"""Verdicts: each where it belongs, with what it must bring along."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from pma_gym.data.trial import Trial
from pma_gym.discovery.report.verdict_text import sentence
from pma_gym.discovery.screening.autocorrelation import SURE, AutocorrelationTest
from pma_gym.discovery.verdict import decision, unknown
from pma_gym.discovery.verdict.adequacy import Adequacy
from pma_gym.discovery.verdict.residual_fraction import ResidualFraction
from pma_gym.discovery.verdict.unknown import Reason
from pma_gym.discovery.workflow import diagnose
from pma_gym.plant.plant import Plant
from tests.discovery.laboratory import (
    LEVELS,
    OFF,
    STATION,
    commanded,
    diagnosed,
    laboratory,
    measured,
)


@cache
def standing(number=2):
    """The diagnosis of trials whose commands never change."""
    plant = Plant(STATION.replace(OFF))
    simulated = []
    for k, trial in enumerate(commanded(number)):
        held = {name: np.full(len(trial), row[0]) for name, row in trial.commands.items()}
        simulated.append(plant.simulate(Trial(trial.time, held), seed=k))
    return diagnose(simulated, STATION)


def test_the_true_model_agrees():
    diagnosis = diagnosed("nothing")
    assert diagnosis.verdict == "agrees"
    assert diagnosis.effects == () and diagnosis.law is None
    assert diagnosis.model == diagnosis.given
    assert "agrees" in diagnosis.sentence


@pytest.mark.parametrize("seed", [5, 6, 7])
def test_the_true_model_agrees_whatever_the_noise(seed):
    diagnosis = diagnose(measured(STATION, 4, rate=32.0, seed=seed), STATION, propose=False)
    assert diagnosis.verdict == "agrees"
    assert not diagnosis.where or min(place.p_value for place in diagnosis.where) > 1e-4


def test_parameters_that_are_off_are_named():
    # Of three trials, one of each kind, two do not hold the parameters for the third.
    diagnosis = diagnosed("parameters", 6)
    assert diagnosis.verdict == "parameters"
    assert diagnosis.effects == ()
    for path, truth in OFF.items():
        moved = diagnosis.parameters[path]
        assert moved.significant
        assert moved.start == pytest.approx(_given(path))
        half = 0.5 * (moved.now.high - moved.now.low)
        assert abs(moved.now.value - truth) < 2.0 * half
        assert path in diagnosis.sentence
    assert diagnosis.model.values_in_files("drive")["gain_n_per_v"] == pytest.approx(
        101.0, rel=2e-3
    )


def test_only_what_moved_is_significant():
    diagnosis = diagnosed("parameters")
    significant = {path for path, moved in diagnosis.parameters.items() if moved.significant}
    assert set(OFF) <= significant
    assert len(significant) <= len(OFF) + 1


def test_intervals_cover_the_truth():
    """Of all the parameters that moved, over several data sets, some 95 %."""
    covered = []
    for seed in (11, 12, 13, 14):
        trials = measured(STATION.replace(OFF), 4, rate=32.0, seed=seed)
        diagnosis = diagnose(trials, STATION, propose=False)
        for path, truth in OFF.items():
            now = diagnosis.parameters[path].now
            covered.append(now.low <= truth <= now.high)
    assert sum(covered) >= 6


def test_hysteresis_is_named_with_its_size():
    diagnosis = diagnosed("hysteresis")
    assert diagnosis.verdict == "effect"
    effect = diagnosis.effects[0]
    assert effect.name == "hysteresis"
    assert len(diagnosis.effects) == 1
    assert effect.p_value <= 0.005
    for name, truth in (("force_n", 6.0), ("distance_mm", 1.0)):
        estimate = effect.parameters[name]
        assert estimate.low < estimate.value < estimate.high
        error = (estimate.high - estimate.low) / 3.92
        assert abs(estimate.value - truth) < 3.0 * error
    assert "hysteresis" in diagnosis.sentence
    assert diagnosis.candidates[0].name == "hysteresis"
    assert diagnosis.candidates[0].why == "added to the model"
    assert diagnosis.candidates[0].held_out_gain > 0.0


def test_an_effect_closes_the_gap_on_trials_it_has_not_seen():
    diagnosis = diagnosed("hysteresis")
    for gap in diagnosis.gap.values():
        assert gap.held_out
    for signal in ("contraction_mm", "rotation_deg"):
        gap = diagnosis.gap[signal]
        assert gap.after < 0.5 * gap.parameters
    load = diagnosis.gap["load_n"]
    assert load.before > 5 * load.after
    assert load.after == pytest.approx(load.floor, rel=0.1)


@pytest.mark.campaign
def test_two_effects_are_both_named():
    diagnosis = diagnosed("pair")
    assert diagnosis.verdict == "effect"
    assert {effect.name for effect in diagnosis.effects} == {"hysteresis", "regulator_delay"}
    delay = next(each for each in diagnosis.effects if each.name == "regulator_delay")
    assert delay.parameters["delay_ms"].value == pytest.approx(20.0, abs=2.0)


def test_what_never_moves_decides_nothing():
    diagnosis = standing()
    assert diagnosis.verdict == "undecidable"
    assert diagnosis.next_experiment is not None
    assert diagnosis.next_experiment.excitation in diagnosis.sentence
    assert diagnosis.next_experiment.separates
    moves = diagnosis.next_experiment.trial.commands
    assert any(np.ptp(row) > 0.0 for row in moves.values())
    assert len(diagnosis.not_detectable) > 10


def test_what_stands_still_does_not_identify_what_moves():
    diagnosis = standing()
    assert "damping.contracting_n_s_per_mm" in diagnosis.not_identifiable
    assert all(diagnosis.not_identifiable.values())


def test_floors_are_the_sensors_noise():
    diagnosis = diagnosed("nothing", 4, 128.0)
    factors = (1e-3, np.pi / 180.0, 1.0, 1e3)
    for floor, level, factor in zip(diagnosis.floors.values(), LEVELS, factors, strict=True):
        assert floor.value * factor == pytest.approx(level, rel=0.25)


def test_an_amended_model_carries_its_intervals():
    diagnosis = diagnosed("hysteresis")
    note = diagnosis.model.notes["hysteresis.force_n"]
    estimate = diagnosis.effects[0].parameters["force_n"]
    assert (note.low, note.high) == pytest.approx((estimate.low, estimate.high))


def found_unseen(with_it, without):
    seen = (
        None if each is None else SimpleNamespace(deviance=np.array(each))
        for each in (with_it, without)
    )
    return SimpleNamespace(**dict(zip(("unseen", "unseen_without"), seen, strict=True)))


@pytest.mark.parametrize(
    ("with_it", "without", "borne_out"),
    [
        ([90.0, 110.0, 100.0], [95.0, 150.0, 99.0], True),  # likelier in all
        ([90.0, 90.0, 500.0], [95.0, 95.0, 100.0], True),  # in most folds
        ([99.0, 200.0, 150.0], [100.0, 120.0, 110.0], False),
        ([np.inf, 90.0, 101.0], [100.0, 95.0, 100.0], False),
        (None, None, True),
    ],
)
def test_trials_left_out_bear_an_effect_out_together_or_in_most_folds(with_it, without, borne_out):
    assert decision._confirmed(found_unseen(with_it, without)) == borne_out


def test_an_effect_that_is_not_borne_out_is_said_to_be_likeliest():
    diagnosis = replace(diagnosed("hysteresis"), verdict="undecidable")
    said = sentence(diagnosis)
    assert "misses something, hysteresis" in said and "most likely" in said
    assert "left out of these 3 trials does not confirm it" in said


UNKNOWN = {
    "slow": (
        Reason("slow", 0.734, 0.35, ("hysteresis",), leaves=0.734),
        "the best, hysteresis, leaves 73 % of what is slow in the residual of these 3 trials, "
        "where at most 35 % may be left.",
    ),
    "slow, hardly": (
        Reason("slow", 0.352, 0.35, ("hysteresis", "slow_creep"), leaves=0.352),
        "the best, hysteresis and slow creep, leave just over 35 % of what is slow in the residual "
        "of these 3 trials, where at most 35 % may be left.",
    ),
    "slow, nothing added": (
        Reason("slow", 1.02, 0.35, nearest="creep", leaves=0.98),
        "none was added (the likeliest, creep, would leave 98 % of chi-square), so 100 % of "
        "what is slow in the residual of these 3 trials is left, where at most 35 % may be.",
    ),
    "autocorrelated": (
        Reason("autocorrelated", 0.21, 0.1, ("hysteresis",), leaves=0.06),
        "the best, hysteresis, leaves 6 % of what is slow in the residual of these 3 trials, but "
        "21 % of its autocorrelation is left, where at most 10 % may be.",
    ),
    "scatters between trials": (
        Reason("scatters", 0.34, 0.12, ("hysteresis",), leaves=0.01, of="hysteresis", by="trial"),
        "the best, hysteresis, leaves 1 % of what is slow in the residual of these 3 trials, but "
        "the size of hysteresis scatters from trial to trial by 34 %, where that of the right law "
        "does by 12 % at most.",
    ),
    "scatters with the load": (
        Reason(
            "scatters", 4e8, 0.12, ("creep", "slow_creep"), leaves=0.0, of="slow_creep", by="load"
        ),
        "the best, creep and slow creep, leave 0 % of what is slow in the residual of these 3 "
        "trials, but the size of slow creep scatters with the load by more than 10 times itself, "
        "where that of the right law does by 12 % at most.",
    ),
    "outdone": (
        Reason(
            "outdone", 812.4, 483.0, ("creep",),
            leaves=0.16, of="residual_force_of_contraction", gain=420.0,
        ),
        "the best, creep, leaves 16 % of what is slow in the residual of these 3 trials, but a "
        "force on the slide drawn freely over contraction explains more: it lowers chi-square by "
        "812, they by 420, and up to 483 would be no better.",
    ),
    "undetermined": (
        Reason("undetermined", 0.4, 1.96, ("joint_spring", "joint_weight"), leaves=0.0, final=True),
        "the best, joint spring and joint weight, leave 0 % of what is slow in the residual of "
        "these 3 trials, but beside each other they are not determined: either may be absent.",
    ),
    "drifts alike": (
        Reason("alike", 7.1e-24, 1e-6, ("slow_creep",), leaves=0.0, of="pressure_kpa", final=True),
        "the best, slow creep, does not carry it, since pressure drifts alike in all trials "
        "(chance 7e-24), and a sensor drifts otherwise in each.",
    ),
    "unexplained": (
        Reason("unexplained", 14.2, 6.0, nearest="creep", leaves=0.983, of="rotation_deg"),
        "none was added (the likeliest, creep, would leave 98 % of chi-square), and the "
        "residual of these 3 trials is autocorrelated in rotation of the pulley for longer than "
        "noise: by 14.2 standard errors, where chance stays below 6.",
    ),
    "unexplained, nothing to try": (
        Reason("unexplained", 14.2, 6.0, of="load_n"),
        "there was none to try, and the residual of these 3 trials is autocorrelated in load for "
        "longer than noise: by 14.2 standard errors, where chance stays below 6.",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("reason", "said"), UNKNOWN.values(), ids=UNKNOWN)
def test_an_unknown_says_what_the_best_leave_and_which_figure_is_beyond_its_limit(reason, said):
    diagnosis = replace(diagnosed("hysteresis"), verdict="unknown", tones={"load_n": 12.5})
    head = "Something is missing in model lab that no effect of the catalogue carries: "
    tone = " What is left of load oscillates at 12.5 Hz."
    assert sentence(diagnosis, reason) == head + said + tone


def made_up(chosen=("creep",), *, gate=True, missing=False, gain=200.0):
    """Findings of which the best score, or fit, takes `gain` off a chi-square of 1000."""
    fit = SimpleNamespace(chi_square=1000.0 - gain)
    stage = SimpleNamespace(
        gate=("some",) if gate else (),
        missing=missing,
        problem=None,
        before=SimpleNamespace(chi_square=1000.0),
        fits={"creep": fit, "filling": SimpleNamespace(chi_square=990.0)} if gate else {},
        scores=[SimpleNamespace(candidate=SimpleNamespace(name="lvdt_error"), gain=gain)],
    )
    before = SimpleNamespace(
        whitened_residuals=lambda _: SimpleNamespace(
            sums=lambda *_: SimpleNamespace(chi_square=1000.0), logged=()
        )
    )
    selection = SimpleNamespace(
        stages=(stage,),
        chosen=tuple(SimpleNamespace(name=name) for name in chosen),
        fit=fit,
        problem=before,
    )
    return SimpleNamespace(
        adequacy=Adequacy({}),
        selection=selection,
        refitted=SimpleNamespace(model=None, values=None),
        rivals=(),
        unseen=None,
        unseen_without=None,
    )


@pytest.fixture
def same_size(monkeypatch):
    """The scatter of each effect's size, by condition; as many as are in it, in turn."""
    sizes = [{"trial": 0.12, "load": 0.0}, {"trial": 0.0, "load": 0.1}]
    monkeypatch.setattr(
        unknown, "homogeneity_test", lambda problem, fit, chosen, place: sizes[place]
    )
    return sizes


def test_what_is_within_its_limits_is_not_unknown(same_size):
    left, law = (
        ResidualFraction(unknown.MOST_LEFT, unknown.MOST_AUTOCORRELATED),
        SimpleNamespace(gain=260.0),
    )
    diagnosis = made_up()
    assert unknown.why_unknown(diagnosis, left, [law]) is None
    assert decision.verdict_of(diagnosis, None, (), False, False) == "effect"


@pytest.mark.parametrize(
    ("left", "why", "figure", "limit"),
    [
        (ResidualFraction(0.4, 0.5), "slow", 0.4, unknown.MOST_LEFT),
        (ResidualFraction(0.1, 0.5), "autocorrelated", 0.5, unknown.MOST_AUTOCORRELATED),
    ],
)
def test_the_first_figure_beyond_its_limit_is_the_reason(same_size, left, why, figure, limit):
    diagnosis = made_up(("creep", "filling"))
    reason = unknown.why_unknown(diagnosis, left, [])
    assert (reason.why, reason.figure, reason.limit) == (why, figure, limit)
    assert (reason.effects, reason.leaves) == (("creep", "filling"), left.slow)
    assert decision.verdict_of(diagnosis, reason, (), False, False) == "unknown"


def test_a_size_that_scatters_is_told_by_where_it_scatters_most(same_size):
    same_size[1].update(pressure=0.2, contraction=0.5)
    reason = unknown.why_unknown(made_up(("creep", "filling")), ResidualFraction(0.01, 0.0), [])
    assert (reason.why, reason.of, reason.by) == ("scatters", "filling", "contraction")
    assert (reason.figure, reason.limit) == (0.5, unknown.MOST_SPREAD)


@pytest.mark.parametrize(("gain", "limit"), [(200.0, 260.0), (600.0, 690.0)])
def test_a_law_that_explains_more_is_named_with_both_gains(same_size, gain, limit):
    law = SimpleNamespace(gain=limit + 1.0, name="residual_load")
    reason = unknown.why_unknown(made_up(gain=gain), ResidualFraction(0.1, 0.0), [law])
    assert (reason.why, reason.of) == ("outdone", "residual_load")
    assert (reason.figure, reason.limit, reason.gain) == (law.gain, pytest.approx(limit), gain)


@pytest.mark.parametrize(("gate", "nearest"), [(True, "creep"), (False, "lvdt_error")])
def test_what_remembers_itself_with_nothing_added_is_told_by_its_surest_signal(
    monkeypatch, gate, nearest
):
    kept = {"contraction": 7.0, "rotation": 30.0, "load": 40.0, "pressure": 9.0}
    autocorrelation_tests = {
        name: AutocorrelationTest(0.0 if name == "load" else 0.2, score, 1.0)
        for name, score in kept.items()
    }
    monkeypatch.setattr(
        unknown, "autocorrelation_tests", lambda problem, fit: autocorrelation_tests
    )
    reason = unknown.why_unknown(
        made_up((), gate=gate, missing=True), ResidualFraction(0.0, 0.0), []
    )
    assert (reason.why, reason.of) == ("unexplained", "rotation_deg")
    assert (reason.figure, reason.limit) == (30.0, SURE)
    assert (reason.effects, reason.nearest) == ((), nearest)
    assert reason.leaves == pytest.approx(0.8)


def test_nothing_added_and_nothing_slow_is_for_other_verdicts(same_size):
    assert unknown.why_unknown(made_up(()), ResidualFraction(0.0, 0.0), []) is None
    assert unknown.why_unknown(made_up((), gate=False), ResidualFraction(1.0, 1.0), []) is None


def test_nothing_is_held_out_of_a_single_trial():
    diagnosis = diagnosed("nothing", 1)
    assert all(not record.held_out for record in diagnosis.trials)


def test_every_trial_has_its_curves():
    trials = laboratory("hysteresis")[0]
    diagnosis = diagnosed("hysteresis")
    assert len(diagnosis.trials) == len(trials)
    for record, trial in zip(diagnosis.trials, trials, strict=True):
        shape = (len(trial), 4)
        assert record.measured.shape == record.before.shape == record.after.shape == shape
        assert np.array_equal(record.measured[:, 2], trial.measurements["load"])


def test_every_candidate_is_accounted_for():
    diagnosis = diagnosed("hysteresis")
    assert len(diagnosis.candidates) > 25
    assert len({each.name for each in diagnosis.candidates}) == len(diagnosis.candidates)
    assert all(each.why for each in diagnosis.candidates)
    assert set(diagnosis.not_detectable) <= {each.name for each in diagnosis.candidates}


def _given(path):
    effect, _, file_key = path.partition(".")
    return STATION.values_in_files(effect)[file_key]


def test_the_widest_scatter_is_over_all_effects_and_conditions(same_size):
    same_size[1].update(contraction=0.5)
    assert unknown.widest_scatter(made_up(("creep", "filling"))) == 0.5
    assert unknown.widest_scatter(made_up(("creep",))) == 0.12
    assert unknown.widest_scatter(made_up(())) == 0.0


def test_a_scatter_that_slopes_alone_tell_is_not_believed_where_nothing_is_left(same_size):
    # A dead zone with a smooth edge: its size scatters with the pressure by 586 %, to first order.
    same_size[0].update(pressure=5.86)
    assert unknown.why_unknown(made_up(), ResidualFraction(0.004, 0.0), []) is None
    left = ResidualFraction(2.0 * unknown.DOUBTFUL, 0.0)
    reason = unknown.why_unknown(made_up(), left, [])
    assert (reason.why, reason.by, reason.figure) == ("scatters", "pressure", 5.86)
