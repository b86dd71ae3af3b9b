"""An environment of a batch reads and draws as the single environment with its seed."""

import sys
from types import ModuleType, SimpleNamespace

import gymnasium as gym
import gymnasium.wrappers.vector
import numpy as np
import pytest

from pma_gym.envs import PMAEnv, PMAVectorEnv

MADE = {"model": "serres2008", "pressure_kpa": 300, "render_mode": "rgb_array"}
READ = (
    "time truth position error measurement pressure ended_by extrapolated disturbance events "
    "operator motor_voltage regulator_voltage motor_voltages voltages"
).split()


@pytest.mark.parametrize("task", ["displacement", "isotonic_exercise"])
def test_a_member_is_the_single_environment(task):
    options = MADE | {"randomisation": "varied", "disturbances": "regulator"}
    if "exercise" in task:
        options = MADE | {"pressure_kpa": 550}
    envs = PMAVectorEnv(3, task, **options)
    singles = [PMAEnv(task, **options) for _ in range(3)]
    envs.reset(seed=4)
    generator = np.random.default_rng(0)
    for i, single in enumerate(singles):
        single.reset(seed=4 + i)
    for _ in range(60):
        actions = generator.uniform(-0.6, 0.0, (3, 1)).astype(np.float32)
        envs.step(actions)
        for single, action in zip(singles, actions, strict=True):
            single.step(action)
    frames = envs.render()
    assert type(frames) is tuple
    for i, single in enumerate(singles):
        member = envs.member(i)
        for name in READ:
            if name == "motor_voltages" and "exercise" in task:
                continue
            np.testing.assert_equal(getattr(member, name), getattr(single, name), err_msg=name)
        assert member.episode_summary() == single.episode_summary()
        assert member.plant.model == single.plant.model
        np.testing.assert_array_equal(member.condition.state, single.condition.state)
        np.testing.assert_array_equal(member.action(3.0), single.action(3.0))
        # The curve has other samples, the rest is the same to the bit.
        picture = single.render()
        np.testing.assert_array_equal(frames[i][:, :370], picture[:, :370])
        differs = np.abs(frames[i].astype(int) - picture).max(axis=2) > 64
        assert differs.sum() < 20
    assert np.any(frames[0] != frames[1])


def test_pictures_go_on_through_the_ends_of_episodes(fragile):
    options = {"model": fragile, "pressure_kpa": 300, "control_rate_hz": 10.0}
    envs = PMAVectorEnv(3, render_mode="rgb_array", max_episode_steps=10, **options)
    envs.reset(seed=1)
    first, ended = envs.render(), 0
    for _ in range(24):
        *_, terminated, truncated, _ = envs.step(np.array([[1.0], [-0.9], [-0.9]], np.float32))
        ends = terminated | truncated
        frames = envs.render() if ends.any() else ()
        if terminated[0]:
            ended += 1
            red = np.all(np.abs(frames[0].astype(int) - [198, 40, 40]) < 40, axis=2)
            assert red.sum() > 50
        if truncated[1]:
            envs.step(np.zeros((3, 1), np.float32))
            assert [envs.member(i).time for i in (1, 2)] == [0.0, 0.0]
            # The dot is where the trial begins, and nothing is left of the episode before.
            again = envs.render()
            assert np.abs(again[1][:, 430:].astype(int) - first[1][:, 430:]).mean() < 0.5
    assert ended > 1


def test_rendering_changes_no_bit():
    results = []
    for mode in (None, "rgb_array"):
        envs = PMAVectorEnv(5, **(MADE | {"render_mode": mode, "control_rate_hz": 10.0}))
        envs.reset(seed=2)
        generator = np.random.default_rng(3)
        for _ in range(60):
            made = envs.step(generator.uniform(-1, 0, (5, 1)))
        results.append(made[:4])
    for plain, drawn in zip(*results, strict=True):
        np.testing.assert_array_equal(plain, drawn)


def test_what_a_member_cannot_say_it_refuses():
    envs = PMAVectorEnv(2, control_rate_hz=10.0)
    member = envs.member(1)
    with pytest.raises(gym.error.ResetNeeded, match="no episode has begun"):
        PMAVectorEnv(2, render_mode="rgb_array").render()
    envs.reset(seed=1)
    envs.step(np.zeros((2, 1)))
    with pytest.raises(AttributeError, match='render_mode="rgb_array"'):
        _ = member.voltages
    with pytest.raises(AttributeError, match="step a single PMAEnv with the same seed"):
        member.trajectory()
    with pytest.raises(RuntimeError, match=r"call step\(\) of the batch"):
        member.step(np.zeros(1))
    with pytest.warns(UserWarning, match='render_mode="rgb_array"'):
        assert envs.render() is None
    for index in (2, -3):
        with pytest.raises(IndexError, match=f"no environment {index} in a batch of 2"):
            envs.member(index)


@pytest.fixture
def films(monkeypatch):
    """Films in place of files: moviepy's encoder alone is replaced."""
    made = []

    class ImageSequenceClip:
        def __init__(self, frames, fps):
            self.frames, self.fps = frames, fps

        def write_videofile(self, path, **options):
            made.append(SimpleNamespace(path=path, frames=self.frames, fps=self.fps))

    for name in (
        "moviepy",
        "moviepy.video",
        "moviepy.video.io",
        "moviepy.video.io.ImageSequenceClip",
    ):
        monkeypatch.setitem(sys.modules, name, ModuleType(name))
    sys.modules["moviepy.video.io.ImageSequenceClip"].ImageSequenceClip = ImageSequenceClip  # type: ignore[attr-defined]
    return made


def test_gymnasium_records_a_film_of_a_batch(films, tmp_path):
    if not hasattr(gym.wrappers.vector, "RecordVideo"):
        pytest.skip(f"Gymnasium {gym.__version__} has no RecordVideo of batches")
    made = MADE | {"control_rate_hz": 10.0, "max_episode_steps": 3}
    envs = gym.make_vec("pma_gym/IsokineticDisplacement-v0", 4, **made)
    folder = str(tmp_path / "films")
    envs = gym.wrappers.vector.RecordVideo(
        envs, folder, episode_trigger=lambda episode: episode == 0
    )
    envs.reset(seed=1)
    for _ in range(5):
        envs.step(np.full((4, 1), -0.9, np.float32))
    envs.close()
    (film,) = films
    # The episode's 3 steps and its first picture.
    assert len(film.frames) == 4 and film.fps == 10
    assert {frame.shape for frame in film.frames} == {(800, 1600, 3)}


def test_stable_baselines_records_a_film_of_a_batch(films, tmp_path):
    pytest.importorskip("stable_baselines3")
    from stable_baselines3.common.vec_env import VecNormalize, VecVideoRecorder

    from pma_gym.sb3 import SB3VecEnv

    inner = VecNormalize(SB3VecEnv(4, control_rate_hz=10.0, **MADE))
    envs = VecVideoRecorder(inner, str(tmp_path), lambda step: step == 0, video_length=2)
    envs.reset()
    for _ in range(4):
        envs.step(np.full((4, 1), -0.5, np.float32))
    (film,) = films
    assert film.fps == 10 and len(film.frames) == 3
    assert {frame.shape for frame in film.frames} == {(800, 1600, 3)}
    assert np.any(film.frames[0] != film.frames[-1])
    assert [one.shape for one in inner.venv.get_images()] == [(400, 800, 3)] * 4
    envs.close()
