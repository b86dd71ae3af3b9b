"""Laws without a shape of their own: drawn where they are, in words."""

from functools import cache

import numpy as np
import pytest

from pma_gym.discovery.verdict.residual_laws import estimated_laws, residual_law, words
from pma_gym.discovery.workflow import diagnose
from tests.discovery.laboratory import BUMP, OFF, STATION, fit_problem, laboratory, measured

AT = np.linspace(0.0, 40.0, 9)
ERRORS = np.full(9, 0.1)
BENT = np.linspace(-1.5, 2.5, 9) * np.abs(np.linspace(-1.5, 2.5, 9)) ** 0.3
CONTRACTION = "contraction (mm)"


@cache
def drawn():
    shared = fit_problem(laboratory("bump", 4)[0])
    refitted = shared.careful_fit(STATION)
    assert refitted is not None
    return estimated_laws(shared, refitted)


def test_the_law_that_is_missing_explains_most():
    laws = drawn()
    assert laws[0].name == "residual_force_of_contraction"
    assert [law.gain for law in laws] == sorted((law.gain for law in laws), reverse=True)
    assert laws[0].gain > 1.5 * laws[1].gain


def test_a_bump_is_drawn_where_it_is():
    law = residual_law(drawn()[0])
    # 10 N at 24 mm, 0 again 8 mm away, less the straight line that parameters take.
    top = int(np.argmax(law.law))
    assert law.at[top] == pytest.approx(24.0, abs=3.0)
    assert 5.0 < law.law[top] < 11.0
    assert law.low[top] > 2.0
    far = np.abs(law.at - 24.0) > 10.0
    assert np.all(law.law[far] < 0.3 * law.law[top])
    assert law.words.startswith("a bump, confined in contraction; most near 2")


def test_what_is_drawn_is_finite_and_within_its_band():
    for each in drawn():
        law = residual_law(each)
        assert len(law.at) == len(law.law) == len(law.low) == len(law.high) > 2
        assert np.isfinite([law.at, law.law, law.low, law.high]).all()
        assert np.all(law.low <= law.law) and np.all(law.law <= law.high)
        assert np.max(law.high - law.low) < 1e4


def test_a_straight_line_is_left_to_parameters():
    law = residual_law(drawn()[0])
    assert abs(np.polyfit(law.at, law.law, 1)[0] * np.ptp(law.at)) < 0.1 * np.max(law.law)


@pytest.mark.campaign
def test_an_effect_outside_the_catalogue_is_unknown():
    truth = STATION.with_effects(BUMP).replace(OFF)
    trials = measured(truth, 6, rate=32.0, kinds=(0,), kpa=(240.0, 300.0))
    diagnosis = diagnose(trials, STATION, propose=False)
    assert diagnosis.verdict == "unknown"
    assert not diagnosis.effects
    assert diagnosis.law is not None
    assert diagnosis.law.variable == CONTRACTION
    assert diagnosis.law.at[int(np.argmax(diagnosis.law.law))] == pytest.approx(24.0, abs=3.0)
    assert "no effect of the catalogue" in diagnosis.sentence


@pytest.mark.parametrize(
    ("law", "said"),
    [
        (
            8.0 * np.exp(-(((AT - 20.0) / 4.0) ** 2)),
            "a bump, confined in contraction; most near",
        ),
        (5.0 * np.cos(np.pi * np.arange(9)), "it changes sign 8 times"),
        (
            BENT,
            "it goes one way over all of contraction",
        ),
        (3.0 * (1.0 - (AT / 20.0 - 1.0) ** 2) + 1.0, "it bends over contraction"),
        (np.zeros(9), "no height of it leaves 0"),
        (0.15 * np.ones(9), "no height of it leaves 0"),
    ],
)
def test_shapes_in_words(law, said):
    assert words(AT, law, ERRORS, CONTRACTION).startswith(said)


def test_words_name_size_place_and_side():
    law = -8.0 * np.exp(-(((AT - 20.0) / 4.0) ** 2))
    assert words(AT, law, ERRORS, CONTRACTION).endswith(
        "most near 20 mm: 8 N less than the model has"
    )
