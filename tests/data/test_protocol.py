import numpy as np
import pytest
from numpy.testing import assert_allclose

from pma_gym.data.protocol import DISPLACEMENT, PROTOCOLS, ROTATION
from pma_gym.metrics import phase_times
from pma_gym.units import SI_FACTORS


def test_displacement_is_5_mm_a_second():
    reference = DISPLACEMENT.reference(np.array([0.0, 1.0, 2.5, 5.0]))
    assert_allclose(reference * 1e3, [0, 5, 12.5, 25], rtol=1e-14)
    assert DISPLACEMENT.duration == 5.0


def test_rotation_goes_to_90_deg_holds_and_returns():
    reference = np.rad2deg(ROTATION.reference(np.array([0.0, 2.5, 5.0, 7.0, 10.0, 11.0, 15.0])))
    assert_allclose(reference, [0, 45, 90, 90, 90, 72, 0], atol=1e-13)
    assert ROTATION.duration == 15.0


def test_the_ends_are_held():
    assert_allclose(ROTATION.reference(np.array([-1.0, 99.0])), 0, atol=1e-15)
    assert_allclose(DISPLACEMENT.reference(99.0), 0.025)


def test_shape_is_kept():
    assert ROTATION.reference(np.zeros((3, 2))).shape == (3, 2)
    assert ROTATION.reference(1.0).shape == ()


@pytest.mark.parametrize("protocol", PROTOCOLS.values(), ids=PROTOCOLS)
def test_phases_join_and_follow_their_lines(protocol):
    end = 0.0
    for index, phase in enumerate(protocol.phases):
        assert phase.start == end == phase_times(index)[0]
        end += phase.duration
        own = np.linspace(0, phase.duration, 11)
        assert_allclose(protocol.reference(phase.start + own), phase.reference(own), atol=1e-15)
    assert np.ptp(protocol.reference(np.linspace(0, end, 16))) == pytest.approx(protocol.span)
    assert protocol.unit in SI_FACTORS


def test_a_phase_is_scored_on_its_line_beyond_its_end():
    own = phase_times()
    reference = ROTATION.phases[0].reference(own)
    assert reference[-1] > ROTATION.span
    assert_allclose(np.rad2deg(reference[-1]), 18 * 1922 / 384)
