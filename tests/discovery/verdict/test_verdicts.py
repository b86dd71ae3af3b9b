"""What a verdict says: which figure is beyond its limit, and what is not sure."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from pma_gym.discovery.report.verdict_text import sentence
from pma_gym.discovery.thresholds import MOST_AUTOCORRELATED, MOST_SPREAD, SLOW_LEFT
from pma_gym.discovery.verdict import decision, unknown
from pma_gym.discovery.verdict.adequacy import Adequacy
from pma_gym.discovery.verdict.residual_fraction import ResidualFraction
from pma_gym.discovery.verdict.unknown import Reason

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


@pytest.fixture(scope="module")
def answer(example):
    """An answer of three files that names Coulomb friction and leaves nothing undetected."""
    files = tuple(replace(each, file=each.name) for each in example.trials)
    named, *others = example.candidates
    return replace(
        example,
        trials=files,
        candidates=(replace(named, why="added to the model"), *others),
        not_detectable=(),
        next_experiment=None,
    )


@pytest.mark.parametrize(("reason", "said"), UNKNOWN.values(), ids=UNKNOWN)
def test_an_unknown_says_what_the_best_leave_and_which_figure_is_beyond_its_limit(
    reason, said, answer
):
    diagnosis = replace(answer, verdict="unknown", tones={"load_n": 12.5})
    head = "Something is missing in model serres2008 that no effect of the catalogue carries: "
    tone = " What is left of load oscillates at 12.5 Hz."
    assert sentence(diagnosis, reason) == head + said + tone


def test_the_headline_says_what_is_not_sure(answer):
    """What trials left out do not confirm, a limit, a rough fit, what got worse, pieces."""
    said = sentence(replace(answer, verdict="undecidable"))
    assert "misses something, Coulomb friction" in said and "most likely" in said
    assert "left out of these 3 trials does not confirm it" in said
    (effect,) = answer.effects
    dynamic = replace(effect.parameters["dynamic_n"], limit="upper")
    limited = replace(effect, parameters=effect.parameters | {"dynamic_n": dynamic})
    worse = ("load_n",), ("run_2.csv",)
    said = sentence(replace(answer, effects=(limited,), converged=False, worsened=worse))
    assert "N (at its upper limit)" in said
    assert "the fit did not converge, so its values are rough" in said
    assert "but it fits load (" in said and "and run_2.csv worse than the model as given" in said
    pieces = tuple(replace(each, file="long.csv") for each in answer.trials)
    assert "this trial (in 3 pieces)" in sentence(replace(answer, trials=pieces))


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


@pytest.mark.parametrize(
    ("left", "why", "figure", "limit"),
    [
        (ResidualFraction(0.4, 0.5), "slow", 0.4, SLOW_LEFT),
        (ResidualFraction(0.1, 0.5), "autocorrelated", 0.5, MOST_AUTOCORRELATED),
    ],
)
def test_the_first_figure_beyond_its_limit_is_the_reason(same_size, left, why, figure, limit):
    diagnosis = made_up(("creep", "filling"))
    reason = unknown.why_unknown(diagnosis, left, [])
    assert (reason.why, reason.figure, reason.limit) == (why, figure, limit)
    assert (reason.effects, reason.leaves) == (("creep", "filling"), left.slow)
    assert decision.verdict_of(diagnosis, reason, (), False, False) == "unknown"


def test_a_size_that_scatters_is_named_with_where_it_scatters_most(same_size):
    same_size[1].update(pressure=0.2, contraction=0.5)
    both = made_up(("creep", "filling"))
    reason = unknown.why_unknown(both, ResidualFraction(0.01, 0.0), [])
    assert (reason.why, reason.of, reason.by) == ("scatters", "filling", "contraction")
    assert (reason.figure, reason.limit) == (0.5, MOST_SPREAD)
    widest = [unknown.widest_scatter(each) for each in (both, made_up(("creep",)), made_up(()))]
    assert widest == [0.5, 0.12, 0.0]


@pytest.mark.parametrize(("gain", "limit"), [(200.0, 260.0), (600.0, 690.0)])
def test_a_law_that_explains_more_is_named_with_both_gains(same_size, gain, limit):
    law = SimpleNamespace(gain=limit + 1.0, name="residual_load")
    reason = unknown.why_unknown(made_up(gain=gain), ResidualFraction(0.1, 0.0), [law])
    assert (reason.why, reason.of) == ("outdone", "residual_load")
    assert (reason.figure, reason.limit, reason.gain) == (law.gain, pytest.approx(limit), gain)
