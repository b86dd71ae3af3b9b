"""Candidates: the whole catalogue, absent where it does nothing, grown within bounds."""

import numpy as np
import pytest

from pma_gym.discovery.fitting.candidate_effect import bounds
from pma_gym.discovery.screening.candidates import FAR, candidate_effects
from pma_gym.discovery.workflow import diagnose
from pma_gym.effects import CATALOGUE
from pma_gym.effects.ports import measured_output
from pma_gym.effects.user_effects import load_effects
from tests.discovery.laboratory import LEVELS, OFF, STATION, fit_problem, laboratory, measured

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


@pytest.fixture(scope="module")
def trials():
    return measured(STATION, 2, rate=64.0, seconds=4.0)


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


def test_a_muscles_own_laws_replace_others():
    kinds = {"force law", "damping law", "person", "free law"}
    assert {effect.replaces for effect in CATALOGUE.values()} - {""} == kinds
    assert {CATALOGUE[name].replaces for name in ("stiffness", "sarosi_force")} == {"force law"}


def test_names_are_unique_and_none_is_already_in_the_model():
    names = [candidate.name for candidate in CANDIDATES]
    assert len(names) == len(set(names))
    for candidate in CANDIDATES:
        if candidate.effect in STATION.parameters:
            # Then it is a number at its neutral value, or a sensor's bandwidth.
            assert candidate.name != candidate.effect
            assert len(candidate.paths) == 1
    having = STATION.with_effects({"hysteresis": {"force_n": 3.0, "distance_mm": 1.0}})
    assert "hysteresis" not in {candidate.name for candidate in candidate_effects(having)}


def test_a_warm_up_needs_repeats_in_order():
    counted = [name for name, effect in CATALOGUE.items() if "repeat" in effect.quantities]
    assert counted
    for orders in (None, [0.0, 0.0]):
        assert not set(counted) & {each.name for each in candidate_effects(STATION, orders)}
    for name in counted:
        assert list(BY_NAME[name].own.values()) == [[0.0, 1.0]]


@pytest.mark.parametrize("name", BY_NAME)
def test_absent_values_change_nothing(name, trials):
    shared, candidate = fit_problem(trials), BY_NAME[name]
    base = shared.whitened_residuals(STATION)
    expected = base.readings(base.start)
    changes = shared.probed(STATION, candidate).readings(candidate.absent)
    assert changes is not None
    for one, other in zip(changes, expected, strict=True):
        # An effect with a memory takes other steps: that much is the integrator's tolerance.
        assert np.max(np.abs(one - other) / LEVELS[:, None]) < 2e-3


@pytest.mark.parametrize("name", BY_NAME)
def test_probes_lie_within_bounds_and_are_each_different(name):
    candidate = BY_NAME[name]
    lower, upper = bounds(candidate.paths)
    assert np.all((candidate.probes >= lower) & (candidate.probes <= upper))
    assert len({tuple(row) for row in candidate.probes}) == len(candidate.probes)
    assert not any(np.array_equal(row, candidate.absent) for row in candidate.probes)
    assert len(candidate.probes) == len(candidate.signs)
    for probe, row in enumerate(candidate.probes):
        np.testing.assert_allclose(candidate.grown(probe, 1.0), row, rtol=1e-12)
        for factor in (-8.0, -1.0, 0.1, 8.0, 1e6):
            if factor > 0.0 or candidate.signs[probe]:
                # Also finite, as these bounds are.
                grown = candidate.grown(probe, factor)
                assert np.all((grown >= lower) & (grown <= upper))


@pytest.mark.parametrize(
    ("name", "factor", "expected"),
    [
        ("hysteresis", 1.5, {"force_n": lambda x: 1.5 * x, "distance_mm": lambda x: x}),
        # A delay grows from nothing.
        ("regulator_delay", 0.5, {"delay_ms": lambda x: 0.5 * x}),
        # The opposite of a wave is half a period later.
        ("torque_ripple", -0.5, {"amplitude_percent": lambda x: 0.5 * x}),
    ],
)
def test_growing_scales_the_size_and_not_the_shape(name, factor, expected):
    candidate = BY_NAME[name]
    for probe, row in enumerate(candidate.probes):
        grown = dict(zip(candidate.paths, candidate.grown(probe, factor), strict=True))
        for path, value in zip(candidate.paths, row, strict=True):
            key = path.partition(".")[2]
            if key == "phase_deg":
                assert abs(grown[path] - value) == 180.0
            elif key in expected:
                assert grown[path] == pytest.approx(expected[key](value))


def test_limits_are_looked_for_over_a_range_and_do_not_scale():
    limits = [
        candidate
        for candidate in CANDIDATES
        if len(candidate.paths) == 1 and candidate.absent[0] > FAR * candidate.probes[0, 0]
    ]
    assert limits
    for candidate in limits:
        assert len(candidate.probes) > 10
        assert not candidate.amplitudes.any()
        assert not candidate.signs.any()


def test_beside_another_model_keeps_its_parameters():
    off = STATION.replace(OFF)
    for candidate in CANDIDATES:
        beside = candidate.beside(off)
        assert beside.values_in_files("drive")["gain_n_per_v"] == OFF["drive.gain_n_per_v"]
        assert candidate.effect in beside.parameters


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
