"""A window shows the episode at real time and closes cleanly; without a screen in tests."""

import copy
import subprocess
import sys
import time

import gymnasium as gym
import numpy as np
import pytest

pygame = pytest.importorskip("pygame")

from pma_gym.cli import main  # noqa: E402
from pma_gym.envs.rendering.display import Window  # noqa: E402


@pytest.fixture
def env(make):
    env = make(render_mode="human", max_episode_steps=30, render_width=400)
    yield env
    env.close()


def shown() -> np.ndarray:
    """What the window shows, shape (height, width, 3)."""
    return pygame.surfarray.array3d(pygame.display.get_surface()).swapaxes(0, 1)


def test_reset_and_steps_are_shown_at_real_time(env):
    env.reset(seed=1)
    begun, over = time.perf_counter(), False
    np.testing.assert_array_equal(shown(), env.picture())
    assert shown().shape == (200, 400, 3)
    while not over:
        *_, over, info = env.step(env.action(4.0))
    assert info["time_s"] == 0.3
    # The pace begins just before `reset` returns.
    assert time.perf_counter() - begun >= 0.29
    np.testing.assert_array_equal(shown(), env.picture())
    assert env.render() is None


def test_it_has_the_bits_of_an_environment_without_a_window(env, make):
    other = make(max_episode_steps=30)
    assert repr(env.reset(seed=1)) == repr(other.reset(seed=1))
    for _ in range(30):
        assert repr(env.step(env.action(4.0))) == repr(other.step(other.action(4.0)))


@pytest.mark.parametrize(
    "event",
    [
        lambda: pygame.event.Event(pygame.QUIT),
        lambda: pygame.event.Event(pygame.KEYDOWN, key=pygame.K_ESCAPE),
        lambda: pygame.event.Event(pygame.KEYDOWN, key=pygame.K_q),
    ],
    ids=["button", "escape", "q"],
)
def test_its_user_closes_it_and_the_episode_goes_on_without(env, event):
    env.reset(seed=1)
    env.step(env.action(1.0))
    assert not env.window_closed
    pygame.event.post(event())
    env.step(env.action(1.0))
    assert env.window_closed and not pygame.display.get_init()
    *_, info = env.step(env.action(1.0))
    assert info["time_s"] == 0.03
    env.reset()
    env.render()
    assert not pygame.display.get_init()


def test_close_closes_the_window_and_twice_does_no_harm(env):
    env.reset(seed=1)
    env.close()
    env.close()
    assert env.window_closed and not pygame.display.get_init()


def test_gymnasium_makes_it_and_a_copy_goes_on_alone():
    env = gym.make("pma_gym/IsokineticDisplacement-v0", render_mode="human")
    assert env.metadata["render_modes"] == ["human", "rgb_array"]
    env.reset(seed=1)
    other = copy.deepcopy(env.unwrapped)
    action = other.action(2.0)
    assert repr(env.unwrapped.step(action)) == repr(other.step(action))
    env.close()
    other.close()


def test_render_needs_an_episode(env):
    with pytest.raises(gym.error.ResetNeeded):
        env.render()


def test_a_picture_is_due_once_in_a_films_time():
    window = Window("")
    window.start()
    window.show(np.zeros((200, 400, 3), np.uint8))
    assert not window.wait(0.0)
    assert window.wait(0.1)
    window.close()
    assert not window.wait(0.2)


def test_without_pygame_it_says_what_installs_it(make, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(gym.error.DependencyNotInstalled, match=r"pip install \"pma-gym\[view\]"):
        make(render_mode="human")
    monkeypatch.setattr(sys, "argv", ["pma-gym", "watch"])
    with pytest.raises(SystemExit, match="2"):
        main()
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and 'pip install "pma-gym[view]"' in error


def test_without_the_extra_sb3_says_in_one_line_what_installs_it():
    code = "import sys; sys.modules['stable_baselines3'] = None; import pma_gym.sb3"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert "During handling" not in result.stderr and result.stderr.splitlines()[-1] == (
        "ModuleNotFoundError: pma_gym.sb3 needs stable_baselines3, which is not installed: "
        'pip install "pma-gym[rl]"'
    )


def test_a_wider_picture_shows_the_same_larger(make):
    env = make(render_mode="rgb_array", render_width=1600)
    usual = make(render_mode="rgb_array")
    env.reset(seed=1)
    usual.reset(seed=1)
    large, small = env.render(), usual.render()
    assert large.shape == (800, 1600, 3) and small.shape == (400, 800, 3)
    quarter = large.reshape(400, 2, 800, 2, 3).mean((1, 3))
    assert np.abs(quarter - small).mean() < 6.0
