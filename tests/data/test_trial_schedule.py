import numpy as np
import pytest
from numpy.testing import assert_allclose

from pma_gym.data.trial_schedule import DISPLACEMENT, ROTATION, SCHEDULES, Phase, TrialSchedule
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


@pytest.mark.parametrize("schedule", SCHEDULES.values(), ids=SCHEDULES)
def test_phases_join_and_follow_their_lines(schedule):
    end = 0.0
    for index, phase in enumerate(schedule.phases):
        assert phase.start == end == phase_times(index)[0]
        end += phase.duration
        own = np.linspace(0, phase.duration, 11)
        assert_allclose(schedule.reference(phase.start + own), phase.reference(own), atol=1e-15)
    assert np.ptp(schedule.reference(np.linspace(0, end, 16))) == pytest.approx(schedule.span)
    assert schedule.unit in SI_FACTORS


def test_a_motion_is_the_reference_of_its_phases_and_held_at_its_ends():
    phases = tuple(Phase(n, s, 2.0, 0.0, 0.0, np.square) for n, s in (("I", 0.0), ("II", 2.0)))
    schedule = TrialSchedule("bow", "extension", "mm", 16.0, phases)
    assert schedule.motion is np.square and schedule.duration == 4.0
    assert_allclose(schedule.reference(np.array([-1.0, 0.0, 3.0, 9.0])), [0.0, 0.0, 9.0, 16.0])
    assert [schedule.at(t) for t in (-1, 0.0, 3.0, 9.0)] == [0.0, 0.0, 9.0, 16.0]
    assert_allclose(phases[1].reference(np.array([0.0, 1.0, 2.5])), [4.0, 9.0, 20.25])
    assert [ROTATION.at(t) for t in (2.0, 16.0)] == ROTATION.reference([2.0, 16.0]).tolist()


@pytest.mark.parametrize(
    ("phases", "words"),
    [
        ((), "one or more"),
        ((Phase("I", 0.0, 5.0, 0.0, 1.0), Phase("II", 4.0, 5.0, 5.0, 0.0)), "at 5 s.*got 4 s"),
        ((Phase("I", 0.0, 0.0, 0.0, 1.0),), "a positive time, got 0 s and 0 s"),
        ((Phase("I", 0.0, 5.0, 0.0, 1.0), Phase("II", 5.0, 5.0, 5.0, 0.0, np.square)), "all lines"),
    ],
)
def test_phases_that_do_not_belong_together_are_refused(phases, words):
    with pytest.raises(ValueError, match=words):
        TrialSchedule("broken", "extension", "mm", 1.0, phases)


def test_a_phase_has_two_samples_more_than_its_duration():
    assert [p.samples for p in ROTATION.phases] == [1923] * 3
    assert [p.first for p in ROTATION.phases] == [0, 1920, 3840]
    assert Phase("whole", 0.0, 10.0, 0.0, 0.0).samples == 3843
    assert_allclose(ROTATION.phases[0].times, phase_times(), rtol=0)


def test_a_phase_is_scored_on_its_line_beyond_its_end():
    own = phase_times()
    reference = ROTATION.phases[0].reference(own)
    assert reference[-1] > ROTATION.span
    assert_allclose(np.rad2deg(reference[-1]), 18 * 1922 / 384)
