"""Laws that fit only approximately: named with their size and with what they leave."""

import json
import re
from dataclasses import replace

import pytest

from pma_gym.discovery.report.approximate_text import why_approximate
from pma_gym.discovery.report.summary import diagnosis_summary
from pma_gym.discovery.report.verdict_text import sentence
from pma_gym.discovery.result.estimates import Approximate
from pma_gym.discovery.verdict import approximate
from pma_gym.discovery.verdict.unknown import Reason
from pma_gym.discovery.workflow import diagnose
from pma_gym.plant.plant import Plant
from tests.discovery.laboratory import STATION, commanded

SIZES = (6.0, 6.0, 8.0, 8.0)
"""Hysteresis (N) in each trial: of no one size, as where it depends on what nobody logged."""


@pytest.mark.campaign
def test_an_effect_of_no_one_size_is_named_with_what_it_leaves(monkeypatch):
    trials = []
    for k, (size, trial) in enumerate(zip(SIZES, commanded(len(SIZES), kinds=(0,)), strict=True)):
        rig = STATION.with_effects({"hysteresis": {"force_n": size, "distance_mm": 1.0}})
        trials.append(Plant(rig).simulate(trial, seed=k))
    # Its law leaves 20 %: what of it is left after others were refitted is not much.
    monkeypatch.setattr(approximate, "APPROXIMATE_LEFT", 0.25)
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


def test_a_residual_that_is_no_noise_is_said_in_noise_floors():
    """Where a law closes most of the misfit it is named although more than the noise is left."""
    misfit = Reason("misfit", 1.63, 1.5, ("joint_friction",), of="angle_deg")
    said = "the law of joint friction is approximate: the misfit of angle is 1.6 noise floors, "
    assert why_approximate(misfit) == said + "of a right law 1.5 at most"
    explained = replace(misfit, why="explained", figure=0.87, limit=0.5)
    words = "a flexible regression explains 0.87 noise floors of what is left of angle"
    assert f"{words}, of a right law 0.5 at most" in why_approximate(explained)
