"""The picture shows the station and the trial."""

import numpy as np
import pytest

from pma_gym.envs.rendering.rig_drawing import BRAID_ANGLE, LENGTH, RADIUS, bulged_radius

BLUE = np.array([21, 101, 192])
"""The curve of the true position."""


@pytest.fixture(params=["displacement", "rotation"])
def env(request, make):
    env = make(request.param, render_mode="rgb_array")
    env.reset(seed=0)
    return env


def blue(picture: np.ndarray) -> int:
    return int(np.sum(np.all(np.abs(picture.astype(int) - BLUE) < 30, axis=2)))


def test_picture_is_an_image(env):
    picture = env.render()
    assert picture.shape == (400, 800, 3)
    assert picture.dtype == np.uint8
    assert 150 < picture.mean() < 255


def test_picture_changes_with_the_station_and_comes_back(env):
    start = env.render()
    for _ in range(100):
        env.step(env.action(3.0))
    later = env.render()
    rig, plot = np.s_[:, :370], np.s_[:, 430:]
    assert np.any(later[rig] != start[rig])
    assert blue(later[plot]) > blue(start[plot])
    env.reset(seed=0)
    np.testing.assert_array_equal(env.render(), start)


def test_pictures_are_new_arrays_and_drawing_changes_no_state(env):
    first = env.render()
    kept, state = first.copy(), env.condition.state.copy()
    env.step(env.action(5.0))
    moved = env.condition.state.copy()
    env.render()
    np.testing.assert_array_equal(first, kept)
    np.testing.assert_array_equal(env.condition.state, moved)
    assert np.any(state != moved)


def test_picture_says_why_an_episode_ended(make, follow):
    env = make(render_mode="rgb_array", pressure_kpa=150.0)
    follow(env, lambda time: 10.0)
    red = np.all(np.abs(env.render().astype(int) - [198, 40, 40]) < 40, axis=2)
    assert red.sum() > 50


def test_frames_of_every_step_play_in_real_time(make):
    assert make(control_rate_hz=10.0).metadata["render_fps"] == 10
    assert type(make()).metadata["render_fps"] == 100


def test_the_braid_keeps_the_length_of_its_threads():
    for contraction in (0.0, 0.02, 0.06):
        cosine = (LENGTH - 1e3 * contraction) / (LENGTH / np.cos(BRAID_ANGLE))
        sine = bulged_radius(contraction) / (RADIUS / np.sin(BRAID_ANGLE))
        assert cosine**2 + sine**2 == pytest.approx(1.0)
