"""Motions to follow: within what they promise, the same for one time as for many, smooth or not."""

import pickle

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pma_gym.data.motions import Pieces, Tones, levels, multisine, shares, triangle, ways
from pma_gym.data.trial_schedule import DISPLACEMENT, ROTATION, SCHEDULES, Phase, TrialSchedule
from pma_gym.metrics import phase_times
from pma_gym.units import SI_FACTORS

TIME = np.arange(3841) / 384.0


def test_a_triangle_goes_up_and_down_at_one_speed():
    positions = triangle(6.0, 4.0, 3)(np.array([0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 11.0, 12.0]))
    np.testing.assert_allclose(positions, [0, 3, 6, 3, 0, 6, 3, 0], atol=1e-15)


def test_a_piece_begins_at_its_time_although_times_are_rounded():
    jump = Pieces((0.0, 1.15), (0.0, 1.0), (0.0, 0.0))
    assert jump(1.15) == jump(1.15 - 1e-12) == 1.0 and jump(1.149) == 0.0


def test_tones_are_sines_and_their_speeds():
    tones = Tones(2.0, (1.0, 0.5), (0.3, 0.7), (0.1, 0.6))
    position, speed = tones.at(TIME)
    turns = [2.0 * np.pi * (0.3 * TIME + 0.1), 2.0 * np.pi * (0.7 * TIME + 0.6)]
    np.testing.assert_allclose(
        position, 2.0 + np.sin(turns[0]) + 0.5 * np.sin(turns[1]), rtol=1e-12
    )
    slope = 0.6 * np.pi * np.cos(turns[0]) + 0.7 * np.pi * np.cos(turns[1])
    np.testing.assert_allclose(speed, slope, atol=1e-12)


def test_a_smooth_motion_is_its_tones_once_it_is_faded_in():
    tones = Tones(2.0, (1.0, 0.5), (0.4, 0.8), (0.75, 0.3))
    smooth = tones.ramped(2.5, 10.0)
    late = TIME[TIME >= 2.5]
    # A cubic between knots 1/64 s apart misses a sine by its fourth derivative h^4 / 384.
    np.testing.assert_allclose(smooth(late), tones.at(late)[0], atol=1e-6)
    assert smooth(0.0) == 0.0
    speeds = np.diff(smooth(TIME)) * 384.0
    assert abs(speeds[0]) < 1e-3
    # No jump of speed, from rest on: the rate of the speed is bounded.
    assert (
        np.abs(np.diff(speeds)).max() * 384.0 < 1.5 * np.abs(np.diff(tones.at(TIME)[1])).max() * 384
    )


def test_tones_are_scaled_to_a_range_or_to_a_speed():
    wide = multisine((0.1, 0.3), 1).scaled(2.0, 8.0, 1e6, 10.0).at(TIME)[0]
    assert (wide.min(), wide.max()) == pytest.approx((2.0, 8.0), abs=1e-2)
    position, speed = multisine((0.1, 0.3), 1).scaled(2.0, 8.0, 1.0, 10.0).at(TIME)
    assert np.abs(speed).max() == pytest.approx(1.0, rel=1e-3)
    assert 0.5 * (position.min() + position.max()) == pytest.approx(5.0, abs=1e-2)


@pytest.mark.parametrize("seed", range(40))
def test_levels_stay_within_their_range_and_steps(seed):
    stairs = levels(seed, 0.25, 0.95, 0.1, 0.3, 10.0)
    sizes = np.abs(np.diff(stairs.positions))
    assert 0.1 <= sizes[1:].min() and sizes.max() <= 0.3 + 1e-12
    assert 0.25 <= min(stairs.positions[1:]) and max(stairs.positions) <= 0.95
    held = np.diff(stairs.starts)
    assert held[0] == 0.5 and 1.0 <= held[1:].min() and held.max() <= 2.0 + 1e-9
    assert stairs(0.0) == 0.0


@pytest.mark.parametrize("seed", range(40))
def test_ways_stay_within_their_range_and_speeds_and_never_jump(seed):
    path = ways(seed, 0.25, 0.95, 0.1, 0.6, 10.0)
    position = path(TIME)
    steps = np.abs(np.diff(position)) * 384.0
    assert 0.0 <= position.min() and position.max() <= 0.95 + 1e-9
    assert position[TIME >= path.starts[1]].min() >= 0.25 - 1e-9
    assert 0.1 <= min(map(abs, path.speeds)) and steps.max() <= 0.6 + 1e-9
    assert path.speeds[0] > 0.0 and {s > 0.0 for s in path.speeds} == {True, False}


@pytest.mark.parametrize(
    "motion",
    [triangle(6.0, 4.0, 3), levels(3, 0.2, 0.9, 0.1, 0.3, 10.0), ways(3, 0.2, 0.9, 0.1, 0.5, 10.0)]
    + [multisine((0.1, 0.5), 7).ramped(2.0, 10.0)],
    ids=lambda motion: type(motion).__name__,
)
def test_one_time_has_the_bits_of_many_and_copies_are_equal(motion):
    together = motion(TIME)
    assert [motion(t) for t in TIME.tolist()] == together.tolist()
    assert motion(TIME.reshape(23, 167)).shape == (23, 167)
    again = pickle.loads(pickle.dumps(motion))
    assert again == motion and hash(again) == hash(motion)
    assert again(TIME).tobytes() == together.tobytes()


def test_random_numbers_are_those_of_the_counter_and_never_change():
    # Frozen: references of a suite are known by their seeds.
    assert shares(0, 1, 2).tolist() == pytest.approx([0.417248125, 0.428239358], abs=1e-9)
    assert not np.array_equal(shares(0, 1, 4), shares(0, 2, 4))
    assert not np.array_equal(shares(0, 1, 4), shares(1 << 32, 1, 4))
    assert levels(0, 0.25, 0.95, 0.1, 0.3, 10.0).positions[1] == pytest.approx(0.271411968)


@pytest.mark.parametrize(
    ("schedule", "duration", "positions"),
    [
        # 5 mm/s; beyond its ends it stands.
        (DISPLACEMENT, 5.0, {0.0: 0, 1.0: 5, 2.5: 12.5, 5.0: 25, 99.0: 25}),
        (
            ROTATION,
            15.0,
            {-1.0: 0, 2.5: 45, 5.0: 90, 7.0: 90, 10.0: 90, 11.0: 72, 15.0: 0},
        ),
    ],
)
def test_the_dissertations_references(schedule, duration, positions):
    expected = np.array([*positions.values()]) * SI_FACTORS[schedule.unit]
    assert_allclose(schedule.reference(np.array([*positions])), expected, rtol=1e-14, atol=1e-15)
    assert schedule.duration == duration


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
