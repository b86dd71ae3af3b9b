"""Candidates: the whole catalogue, and what a user adds to it."""

import pytest

from pma_gym.discovery.screening.candidates import candidate_effects
from pma_gym.discovery.screening.score_test import ScreeningScore
from pma_gym.discovery.screening.starting_points import starting_points
from pma_gym.discovery.workflow import diagnose
from pma_gym.effects import CATALOGUE
from pma_gym.effects.ports import measured_output
from pma_gym.effects.user_effects import load_effects
from tests.discovery.laboratory import STATION, laboratory, measured

CANDIDATES = candidate_effects(STATION, [0.0, 1.0])
BY_NAME = {candidate.name: candidate for candidate in CANDIDATES}

OWN = '''
from typing import Annotated, NamedTuple
from pma_gym.effects import Effect
from pma_gym.units import Quantity

class Swirl(NamedTuple):
    """Parameters of `swirl`."""

    factor: Annotated[
        float, Quantity("N s^2/mm^2", 0, 1, "assumption: 0.02", 0.0, usual=0.02)
    ]

def swirl(velocity, p):
    """Force as the square of speed."""
    return -p.factor * velocity * abs(velocity)

SWIRL = Effect("swirl", "slide_force", Swirl, swirl, signature="force as the square of speed")
'''


def test_every_effect_that_can_be_absent_is_a_candidate_or_replaces_another_law():
    effects = {candidate.effect for candidate in CANDIDATES}
    for name, effect in CATALOGUE.items():
        if effect.replaces:
            assert name not in effects
        elif (measured_output(effect.port) or effect.port) not in (
            *STATION.rig.ports,
            *STATION.rig.outputs,
        ):
            # It acts where another rig has a port.
            assert name not in effects
        elif effect.law and effect.neutral is not None and name not in STATION.parameters:
            assert name in effects, name


def test_fits_of_a_candidate_of_which_no_probe_explains_anything_begin_nowhere():
    idle = ScreeningScore(BY_NAME["hysteresis"], 0.0, 1.0, -1, 0.0, 0.0, None, ())
    assert starting_points(None, None, idle) == []


def test_a_warm_up_needs_repeats_in_order():
    counted = [
        name
        for name, effect in CATALOGUE.items()
        if "repeat" in effect.quantities and not effect.of
    ]
    assert counted
    for orders in (None, [0.0, 0.0]):
        assert not set(counted) & {each.name for each in candidate_effects(STATION, orders)}
    for name in counted:
        assert list(BY_NAME[name].own.values()) == [[0.0, 1.0]]


@pytest.mark.campaign
def test_an_effect_of_ones_own_takes_part(forget_user_effects, tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(OWN, encoding="utf-8")
    load_effects(path)
    assert "swirl" in {candidate.name for candidate in candidate_effects(STATION)}
    truth = STATION.with_effects({"swirl": {"factor_n_s2_per_mm2": 0.05}})
    diagnosis = diagnose(measured(truth, 4), STATION, propose=False)
    assert [effect.name for effect in diagnosis.effects] == ["swirl"]


def test_the_catalogue_is_as_it_was():
    assert "swirl" not in CATALOGUE
    assert laboratory("nothing", 1)[1].name == STATION.name
