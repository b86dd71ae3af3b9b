"""Laws that fit only approximately: named with their size and with what they leave."""

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pma_gym.discovery.report.approximate_text import left_text, why_approximate
from pma_gym.discovery.report.summary import diagnosis_summary
from pma_gym.discovery.report.verdict_text import sentence
from pma_gym.discovery.result.estimates import Approximate, Estimate, NamedEffect
from pma_gym.discovery.result.misfit import Gap
from pma_gym.discovery.verdict import approximate, unknown
from pma_gym.discovery.verdict.adequacy import Adequacy, SignalAdequacy
from pma_gym.discovery.verdict.approximate import LEAST_MISFIT, MOST_LEFT, closing
from pma_gym.discovery.verdict.residual_fraction import ResidualFraction
from pma_gym.discovery.verdict.unknown import Reason, leaves_structure
from pma_gym.discovery.workflow import diagnose
from pma_gym.plant.plant import Plant
from tests.discovery.laboratory import STATION, commanded

ONE, TWO = ("hysteresis",), ("hysteresis", "creep")
"""Names of one effect, and of two with laws of their own."""

SIZES = (6.0, 6.0, 8.0, 8.0)
"""Hysteresis (N) in each trial: of no one size, as where it depends on what nobody logged."""


def gaps(parameters, after, held_out=True):
    """Gaps of two signals, one of them nothing but noise."""
    signal = Gap(9.0, parameters, after, 1.0, held_out)
    return {"load_n": signal, "contraction_mm": Gap(2.0, 0.5, 0.5, 0.5, held_out)}


def test_what_is_left_is_a_share_of_the_mean_square_beyond_noise():
    known = closing(gaps(11.0**0.5, 2.0**0.5), ONE)
    assert known is not None
    assert known.left == pytest.approx(0.1) and known.closed == pytest.approx(0.9)
    assert known.left < MOST_LEFT and known.named and known.worth_saying
    # A share of hardly anything is none.
    assert closing(gaps((1.0 + 0.9 * LEAST_MISFIT) ** 0.5, 1.0), ONE) is None


@pytest.mark.parametrize(
    ("gap", "effects", "named", "worth_saying"),
    [
        (gaps(11.0**0.5, 5.0**0.5), ONE, False, True),  # what closes less is not named
        (gaps(11.0**0.5, 3.0), ONE, False, False),  # and what closes little not sized
        (gaps(4.0, 1.1), TWO, False, True),
        (gaps(4.0, 1.1, held_out=False), ONE, False, True),
        # Terms of one law count as one.
        (gaps(11.0**0.5, 2.0**0.5), ("contact_friction", "pressure_friction"), True, True),
    ],
)
def test_one_law_that_closes_much_of_what_was_left_out_is_named(gap, effects, named, worth_saying):
    known = closing(gap, effects)
    assert known is not None and (known.named, known.worth_saying) == (named, worth_saying)


JUDGED = SignalAdequacy(None, 6.0, 0.0, 0.0, 6.0, "misfit")


def findings(effects, before, after, errors=5.0, adequacy=None, rivals=()):
    """Effects that take the misfit from so many noises to so many, with sizes of so many errors."""
    equal = tuple(
        SimpleNamespace(candidate=SimpleNamespace(name=name, effect=name), equal=True)
        for name in rivals
    )
    return SimpleNamespace(
        problem=SimpleNamespace(count=100, sum_of_squares=lambda model, *_: 100 * model**2),
        refitted=SimpleNamespace(model=before),
        selection=SimpleNamespace(chosen=list(map(sized, effects)), fit=fit_with(after, errors)),
        rivals=(equal, *[()] * (len(effects) - 1)),
        adequacy=adequacy or SimpleNamespace(structure=None, alike=None),
    )


@pytest.fixture
def reason_of(monkeypatch):
    """Why findings leave structure; `after` noises are left of one signal."""

    def reason(made, fraction=ResidualFraction(0.2, 0.05), signal="contraction"):  # noqa: B008
        left = {signal: made.selection.fit.model, "rotation": 0.0}
        monkeypatch.setattr(unknown, "left_in_noises", lambda *_: left)
        return leaves_structure(made, fraction)

    return reason


@pytest.mark.parametrize(
    ("after", "structure", "figure"),
    [
        (50.0, None, 50.0),  # no floor but the sensor's noise: far beyond that
        (7.0, None, None),
        (7.0, JUDGED, 6.0),
        (3.0, JUDGED, None),
    ],
)
def test_effects_that_leave_much_structure_are_not_it(after, structure, figure, reason_of):
    """Of 10 noises, or twice what is left where that is more."""
    judged = SimpleNamespace(structure=structure and ("load", structure), alike=None)
    made = findings(ONE, max(10.0, 2.0 * after), after, adequacy=judged)
    reason = reason_of(made, signal="load")
    assert (reason and reason.figure) == figure
    if reason is not None:
        said = (reason.why, reason.of, reason.effects, reason.leaves)
        assert said == ("misfit", "load_n", ONE, 0.2)


def test_a_drift_alike_in_all_trials_withholds_the_name_of_what_explains_all(reason_of):
    judged = Adequacy({"pressure": SignalAdequacy(None, 1.0, 0.0, 0.0, 1.0, "alike", 1e-9)})
    reason = reason_of(findings(("creep",), 50.0, 1.0, adequacy=judged))
    assert reason is not None and reason.final and reason.figure == 1e-9
    assert (reason.why, reason.of, reason.effects) == ("alike", "pressure_kpa", ("creep",))


@pytest.mark.parametrize(
    ("effects", "rivals", "before", "after", "unknown_by"),
    [
        # The difference of two draws any bent curve.
        (("joint_spring", "joint_weight"), (), 50.0, 1.8, 1.8),
        (("joint_spring", "joint_weight"), (), 50.0, 1.05, None),
        (("joint_spring", "joint_friction"), (), 50.0, 1.8, None),
        (("spring", "cogging"), (), 50.0, 3.0, 3.0),
        (("constant_torque",), ("joint_hardening_spring",), 4.0, 1.8, 1.8),
        (("constant_torque",), ("joint_hardening_spring",), 4.0, 1.05, None),
        # What closes 99.9 % is it; something small is beside.
        (("constant_torque",), ("joint_hardening_spring",), 50.0, 1.8, None),
        (("constant_torque",), (), 4.0, 1.8, None),
        (("constant_torque",), ("joint_friction",), 4.0, 1.8, None),
        (("joint_friction",), ("joint_spring", "constant_torque"), 4.0, 1.8, None),
    ],
)
def test_two_laws_of_the_position_leave_noise_or_are_unknown(
    effects, rivals, before, after, unknown_by, reason_of
):
    reason = reason_of(findings(effects, before, after, rivals=rivals), ResidualFraction(0.0, 0.0))
    assert (reason and reason.figure) == unknown_by
    assert reason is None or (reason.final and reason.effects == effects)


@pytest.mark.parametrize(
    ("effects", "errors", "unknown_by"),
    [
        (("joint_spring", "joint_weight"), 0.4, 0.4),
        (("joint_spring", "joint_weight"), 2.5, None),
        (("joint_spring", "joint_friction"), 0.4, None),
        (("joint_spring",), 0.4, None),
    ],
)
def test_two_laws_of_the_position_that_may_be_absent_are_unknown(
    effects, errors, unknown_by, reason_of
):
    """Their sizes, so many standard errors, are those of a curve that neither has."""
    reason = reason_of(findings(effects, 50.0, 1.0, errors), ResidualFraction(0.0, 0.0))
    assert (reason and reason.figure) == unknown_by
    assert reason is None or (reason.why, reason.final) == ("undetermined", True)


def sized(name):
    """A candidate with one size, 0 where it is absent."""
    path = f"{name}.size"
    return SimpleNamespace(
        name=name,
        effect=name,
        paths=[path],
        fitted_paths=[path],
        amplitudes=np.array([True]),
        absent=np.zeros(1),
    )


def fit_with(model, errors):
    """A fit whose sizes are so many standard errors."""
    return SimpleNamespace(model=model, estimate=lambda path: (errors, 1.0))


@pytest.mark.campaign
def test_an_effect_of_no_one_size_is_named_with_what_it_leaves(monkeypatch):
    trials = []
    for k, (size, trial) in enumerate(zip(SIZES, commanded(len(SIZES), kinds=(0,)), strict=True)):
        rig = STATION.with_effects({"hysteresis": {"force_n": size, "distance_mm": 1.0}})
        trials.append(Plant(rig).simulate(trial, seed=k))
    # Its law leaves 20 %: what of it is left after others were refitted is not much.
    monkeypatch.setattr(approximate, "MOST_LEFT", 0.25)
    diagnosis = diagnose(trials, STATION, propose=False)
    (effect,), known = diagnosis.effects, diagnosis.approximate
    assert (diagnosis.verdict, effect.name) == ("effect", "hysteresis"), diagnosis.sentence
    assert min(SIZES) < effect.parameters["force_n"].value < max(SIZES)
    assert known is not None and known.effects == diagnosis.effects and known.held_out
    assert 0.1 < known.left < 0.25
    assert re.search("law approximate.*of the misfit beyond noise", diagnosis.sentence)
    assert any("law of hysteresis is approximate: 1" in words for words in diagnosis.warnings)
    written = json.loads(diagnosis.text())["approximate"]
    figures = known.left, 1.0 - known.left
    assert (written["left"], written["closed"]) == pytest.approx(figures)
    assert [each["name"] for each in written["effects"]] == ["hysteresis"]
    assert "law approximate" in diagnosis_summary(diagnosis)


def test_an_unknown_says_its_best_candidate_with_its_size_and_what_is_left(example):
    left = Approximate(example.effects, 0.35, True)
    unknown_one = replace(example, verdict="unknown", effects=(), approximate=left)
    reason = Reason("slow", 0.4, 0.35, ("coulomb_friction",), leaves=0.4)
    said = sentence(unknown_one, reason)
    assert "that no effect of the catalogue carries" in said
    assert "The best candidate is Coulomb friction (" in said
    assert "it closes 65 % of the misfit beyond noise" in said
    assert "law approximate, 35 % of the misfit beyond noise (mean square) is left" in said
    assert "best candidate" not in sentence(replace(unknown_one, approximate=None), reason)


@pytest.mark.parametrize("why", ["slow", "autocorrelated", "scatters", "outdone"])
def test_every_reason_says_its_figure_and_its_limit(why):
    of = {"scatters": "hysteresis", "outdone": "residual_load"}.get(why, "")
    reason = Reason(why, 0.42, 0.12, ("hysteresis",), of=of, by="load", gain=0.3)
    said = why_approximate(reason)
    assert said.startswith("the law of hysteresis is approximate: ")
    assert ("42 %" in said and "12 %" in said) if why != "outdone" else "0.42" in said


def test_a_residual_that_is_no_noise_is_said_in_noise_floors():
    """Where a law closes most of the misfit it is named although more than the noise is left."""
    misfit = Reason("misfit", 1.63, 1.5, ("joint_friction",), of="angle_deg")
    said = "the law of joint friction is approximate: the misfit of angle is 1.6 noise floors, "
    assert why_approximate(misfit) == said + "of a right law 1.5 at most"
    explained = replace(misfit, why="explained", figure=0.87, limit=0.5)
    words = "a flexible regression explains 0.87 noise floors of what is left of angle"
    assert f"{words}, of a right law 0.5 at most" in why_approximate(explained)


def test_two_laws_are_both_approximate():
    size = {"force_n": Estimate(8.0, 7.0, 9.0, "N")}
    two = tuple(NamedEffect(name, (), 0.001, size) for name in ("hysteresis", "creep"))
    assert left_text(Approximate(two, 0.3, True)).startswith("laws approximate, 30 %")
    assert "left out" not in left_text(Approximate(two, 0.3, False))
