"""Every rig is an environment: contracts over all of them."""

import copy
import json
import pickle
import re
from dataclasses import dataclass, replace

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from stable_baselines3 import PPO
from stable_baselines3.common.env_checker import check_env as check_sb3

from pma_gym import Plant, Trial
from pma_gym.envs import EnvState, PMAEnv, RigEnv, RigVectorEnv
from pma_gym.plant.model import load_model, parse_model, shipped_models
from pma_gym.sb3 import SB3RigVecEnv, SB3VecEnv
from pma_gym.tasks import Ranges, Uncertainty, phase_rmse, tracking

HEAD = {"schema": 1, "name": "mine", "title": "a rig of a test"}
JOINT = parse_model(
    HEAD
    | {
        "plant": "joint",
        "dc_motor": {"torque_constant_n_m_per_a": 0.4, "resistance_ohm": 4.0},
        "joint_weight": {"moment_n_m": 0.3, "offset_deg": 0.0},
        "joint_friction": {
            "static_n_m": 0.03, "dynamic_n_m": 0.02,
            "stribeck_speed_deg_per_s": 5.0, "presliding_deg": 0.02,
        },
        "inertia": {"inertia_kg_m2": 0.0067},
        "joint_start": {"angle_deg": 10.0, "spin_deg_per_s": 0.0},
        "encoder": {"bandwidth_hz": 200, "noise_deg": 0.05},
        "gyroscope": {"bandwidth_hz": 100, "noise_rad_per_s": 0.01},
    }
)  # fmt: skip
SLIDE = parse_model(
    HEAD
    | {
        "plant": "slide",
        "two_way_drive": {"gain_n_per_v": 20, "middle_v": 5},
        "slide": {"mass_kg": 2.0},
        "start": {"contraction_mm": 5.0, "velocity_mm_per_s": 0.0},
        "lvdt": {"bandwidth_hz": 300, "noise_mm": 0.02},
    }
)
OPTIONS = {
    "joint": {"model": JOINT, "limits": {"winding_voltage": [-7.4, 7.4]}, "span": 1.2},
    "slide": {"model": SLIDE, "span": 0.05},
} | {model.plant: {"model": name} for name in shipped_models() for model in [load_model(name)]}
"""Options of an environment of every rig, by its name."""
VALVES = load_model("valve_pair")
MOVED = ("inertia.inertia_kg_m2", "slide.mass_kg", "lvdt.noise_mm")
"""Parameters that are drawn, the first that a model has."""


@pytest.fixture(params=OPTIONS)
def options(request) -> dict:
    """Options of an environment of a rig."""
    return OPTIONS[request.param] | {"control_rate_hz": 50.0, "duration_s": 1.0}


def everything(options: dict) -> dict:
    """Nearly all that an episode depends on."""
    model = load_model(options["model"])
    path = next(each for each in MOVED if each in set(model.paths()))
    effect, _, name = path.partition(".")
    value = model.values_in_files(effect)[name]
    ends, rig = [0.8 * value, 1.2 * value], model.rig
    return options | {
        "randomisation": {path: ends}, "reference": "random", "preview": 2, "history": 1,
        "action_delay_s": 0.04, "observation_delay_s": 0.02, "duration_s": 3.0,
        "max_episode_steps": 30,
        **({"load": [-0.1, 0.1], "push": 0.2} if rig.push_port else {}),
    }  # fmt: skip


def acted(env, steps: int, seed: int = 0) -> list:
    """What an environment gives for random actions."""
    generator, seen = np.random.default_rng(seed), []
    for _ in range(steps):
        seen.append(env.step(generator.uniform(-1.0, 1.0, env.action_space.shape)))
    return seen


def same(first, second) -> bool:
    """Whether two values have the same bits."""
    return pickle.dumps(first) == pickle.dumps(second) or repr(first) == repr(second)


def test_checkers_find_nothing(options, recwarn):
    options = {**options, "noise": True}
    check_env(gym.make("pma_gym/Rig-v0", **options).unwrapped, skip_render_check=True)
    check_sb3(RigEnv(**options))
    check_sb3(RigEnv(goal=True, **options))
    # Gymnasium says that a Box of commands could be narrower, and knows none of the goals' ranges.
    assert [str(w.message) for w in recwarn if "not within" in str(w.message)] == []


def test_its_picture_shows_rig_and_course_and_comes_back(options):
    env = RigEnv(render_mode="rgb_array", render_width=400, **options)
    env.reset(seed=0)
    start = env.render()
    acted(env, 30)
    later = env.render()
    assert start.shape == (200, 400, 3) and start.dtype == np.uint8
    for part in (np.s_[:, :185], np.s_[:100, 215:], np.s_[100:, 215:]):
        assert np.any(start[part] != later[part])
    env.reset(seed=0)
    np.testing.assert_array_equal(env.render(), start)


@pytest.mark.parametrize("rig", ["joint", "muscle_joint", "muscle_pair"])
def test_a_drawn_arm_hangs_at_zero_and_its_reference_is_across_at_a_right_angle(rig):
    env = RigEnv(tracking("angle", Across()), render_mode="rgb_array", **OPTIONS[rig])
    env.reset(seed=0)
    drawn = env.render()[:, :376].astype(int)
    mark = np.argwhere(np.all(np.abs(drawn - [0xE0, 0x7B, 0x00]) < 8, axis=2)).mean(axis=0)
    # The axis is at row 175, column 188; the mark beyond the arm's end, on the right.
    np.testing.assert_allclose(mark, [175.0, 327.0], atol=4.0)


def test_it_moves_as_the_plant_does(options):
    env = RigEnv(**options, noise=False)
    _, info = env.reset(seed=0)
    resting = env._engine.actions[0] * 0.0
    resting[:] = [env._number(f"action_{i}") for i in range(len(resting))]
    infos = [info]
    generator = np.random.default_rng(1)
    for k in range(50):
        # The plant begins settled at its first commands.
        action = resting + (k > 0) * 0.3 * generator.uniform(-1.0, 1.0, len(resting))
        *_, info = env.step(action)
        infos.append(info)
    keys = [
        next(k for k in info if k.startswith(f"{c.signal.name}_")) for c in env.options.commands
    ]
    given = np.array([[each[key] for key in keys] for each in [*infos[1:], infos[-1]]]).T
    commands = {c.signal.name: row for c, row in zip(env.options.commands, given, strict=True)}
    trial = Trial(0.02 * np.arange(51), commands)
    made = Plant(env.options.nominal).simulate(trial, noise=False, interpolation="zoh")
    for signal in env.options.outputs:
        key = next(k for k in infos[0] if k.startswith(f"{signal.name}_"))
        got = np.array([info[key] for info in infos])
        np.testing.assert_allclose(got, made.truth[signal.name], rtol=1e-12, atol=1e-12)
    for signal in env.options.signals:
        key = next(k for k in infos[0] if k.startswith(f"measured_{signal.name}_"))
        got = np.array([info[key] for info in infos])
        # A valve's flow is near what a lag's source may cost (`step_attempt.DEAREST`): here its lag
        # is stepped by the stages, there after them. Both are within the tolerance, 0.03 noise.
        near = 5e-5 if "valve_spool" in env.options.nominal.effects else 1e-12
        np.testing.assert_allclose(got, made.measurements[signal.name], rtol=near, atol=1e-12)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_a_batch_has_the_bits_of_single_environments(options, mode):
    options = everything(options)
    envs = gym.make_vec(
        "pma_gym/Rig-v0", num_envs=9, vectorization_mode="vector_entry_point",
        autoreset_mode=mode, **options,
    )  # fmt: skip
    singles = [RigEnv(**options) for _ in range(9)]
    observations, _ = envs.reset(seed=3)
    for i, single in enumerate(singles):
        assert same(single.reset(seed=3 + i)[0], observations[i])
    generator, over = np.random.default_rng(0), np.zeros(9, bool)
    for _ in range(40):
        actions = generator.uniform(-1.0, 1.0, envs.action_space.shape)
        if mode == "Disabled" and over.any():
            envs.reset(options={"reset_mask": over})
            for i in np.flatnonzero(over):
                singles[i].reset()
            over[:] = False
        observations, rewards, terminated, truncated, info = envs.step(actions)
        for i, single in enumerate(singles):
            if mode == "NextStep" and over[i]:
                assert same(single.reset()[0], observations[i]) and rewards[i] == 0.0
                continue
            its = single.step(actions[i])
            assert [its[1], its[2], its[3]] == [rewards[i], terminated[i], truncated[i]]
            if its[2] or its[3]:
                last = info["final_info"] if mode == "SameStep" else info
                assert {k: v for k, v in its[4].items()} == {k: last[k][i] for k in its[4]}
            final = mode == "SameStep" and (its[2] or its[3])
            assert same(its[0], info["final_obs"][i] if final else observations[i])
            if final:
                assert same(single.reset()[0], observations[i])
        over = terminated | truncated
    assert envs.unwrapped.member(0).task.name == singles[0].task.name


def test_copies_and_states_go_on_with_the_same_bits(options):
    options = everything(options)
    env = RigEnv(**options)
    env.reset(seed=4)
    acted(env, 5)
    state = env.get_state()
    others = [copy.deepcopy(env), pickle.loads(pickle.dumps(env)), RigEnv(**options)]
    ahead = acted(env, 8)
    for other in others[:2]:
        assert repr(acted(other, 8)) == repr(ahead)
    others[2].set_state(EnvState.from_json(state.to_json()))
    assert repr(acted(others[2], 8)) == repr(ahead)
    env.reset(seed=4)
    acted(env, 5)
    assert repr(acted(env, 8)) == repr(ahead)
    env.reset(seed=5)
    assert repr(acted(env, 8)) != repr(ahead)


def test_rewards_scores_and_goals_are_of_the_true_error(options):
    env = RigEnv(**options, goal=True, reward="quadratic")
    observation, info = env.reset(seed=2)
    unit = env.task.schedule.suffix
    for _ in range(60):
        observation, reward, terminated, truncated, info = env.step(env.action_space.sample() * 0.1)
        percent = 100.0 * info[f"error_{unit}"] / env.task.schedule.span
        assert reward == pytest.approx(-(percent**2), rel=1e-9)
        goals = observation["achieved_goal"], observation["desired_goal"]
        assert env.compute_reward(*goals, info) == pytest.approx(reward, rel=1e-9, abs=1e-12)
        if truncated:
            break
    expected = phase_rmse(env.task.schedule, env.trajectory())["all"]
    assert truncated and info[f"rmse_{unit}"] == pytest.approx(expected, rel=1e-9)


def test_the_arguments_survive_json(options):
    options = {**options, "model": "station"} if isinstance(options["model"], str) else options
    spec = gym.make("pma_gym/Rig-v0", **options).spec
    assert spec is not None and spec.max_episode_steps == 51
    if isinstance(options["model"], str):
        assert json.loads(spec.to_json())["kwargs"]["duration_s"] == 1.0


def _chirp(generator):
    """A reference of a user's own, which only this episode has."""
    rate = float(generator.uniform(0.5, 2.0))
    return tracking("angle", lambda time: 0.2 + 0.3 * np.sin(rate * time * time), span=1.2)


@pytest.mark.parametrize("frequency", [0.0, 0.1, 2.0])
def test_a_sine_has_the_frequency_of_its_name(frequency):
    env = RigEnv(f"angle_sine_{frequency:g}hz", model="muscle_pair", span=1.0)
    times = np.arange(2.5, 10.0, 0.01)
    turns = frequency * times + 0.75
    reference = env.task.schedule.reference(times)
    assert reference == pytest.approx(0.5 + 0.2 * np.sin(2.0 * np.pi * turns), abs=1e-4)
    with pytest.raises(ValueError, match=r"angle_sine_2hz \(0 to 10 Hz\).*'angle_sine_11hz'"):
        RigEnv("angle_sine_11hz", model="muscle_pair")


@pytest.mark.parametrize("reference", ["random", ["angle_sine", "angle_ramps_4"], _chirp])
def test_every_reset_draws_a_reference_by_the_seed(reference):
    options = OPTIONS["joint"] | {"noise": False, "preview": 1, "control_rate_hz": 50.0}
    env, courses = RigEnv("angle_steps", reference=reference, **options), {}
    for seed in (*range(6), 0):
        env.reset(seed=seed)
        observation, *_, info = env.step(np.zeros(1))
        course = [env.reference(0.02 * k) for k in range(0, 400, 20)]
        assert courses.setdefault(seed, course) == course
        assert info["reference_rad"] == env.reference(0.02)
        assert info["error_rad"] == pytest.approx(info["angle_rad"] - env.reference(0.02))
        # Angle, speed, the reference and its error; then one ahead.
        assert observation[4] == pytest.approx(env.reference(0.04) / 1.2, abs=1e-6)
    assert len(set(map(tuple, courses.values()))) > 1


def test_a_policy_trains_on_a_batch_of_any_rig():
    envs = SB3VecEnv(8, "pma_gym/Rig-v0", **everything(OPTIONS["joint"]))
    model = PPO("MlpPolicy", envs, n_steps=32, batch_size=64, n_epochs=1, device="cpu", seed=0)
    model.learn(512)
    assert model.ep_info_buffer[0]["l"] == 30
    envs.close()


def test_a_load_accelerates_a_free_slide():
    env = RigEnv("contraction_steps", load=3.0, **OPTIONS["slide"], noise=False)
    env.reset(seed=0)
    for _ in range(50):
        *_, info = env.step(env.action(0.0))
    assert info["contraction_m"] == pytest.approx(5e-3 + 0.5 * 3.0 / 2.0 * 0.5**2, rel=1e-9)
    assert info["push_force"] == 3.0


def test_an_episode_ends_beyond_a_bound():
    env = RigEnv(bounds={"contraction": [0.0, 0.02]}, load=3.0, **OPTIONS["slide"])
    env.reset(seed=0)
    steps = 0
    terminated = False
    while not terminated:
        *_, terminated, _, info = env.step(env.action(0.0))
        steps += 1
    assert info["contraction_m"] > 0.02 and env.ended_by == "contraction beyond 0 to 0.02 m"
    assert 0.01 * steps == pytest.approx((2 * 0.015 / 1.5) ** 0.5, abs=0.01)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"limits": {}}, 'has no limits of winding_voltage'),
        ({"limits": {"winding_voltage": [3, 1]}}, "two numbers in V, the lower first"),
        ({"limits": {"torque_command": [-1, 1]}}, "commands winding_voltage"),
        ({"task": "angle"}, "task must be a signal of the rig (angle, speed) with steps"),
        ({"task": "contraction_steps"}, "got 'contraction_steps'"),
        ({"task": tracking("load", np.sin)}, "task must be a signal of the rig (angle, speed)"),
        ({"bounds": {"load": [0, 1]}}, "the rig has angle, speed"),
        ({"rest": {"load_command": 1.0}}, "the rig commands winding_voltage"),
        ({"pressure_kpa": 300}, "unexpected keyword argument 'pressure_kpa'"),
        ({"load": [1.0]}, "load must be a number or two"),
        ({"compiled": False}, "unexpected keyword argument 'compiled'"),
        ({"reference": ["speed_steps"]}, "speed_steps differs"),
        ({"reference": "rand"}, "'rand' is no task of this rig, such as angle_steps_3"),
        ({"model": replace(JOINT, parameters={k: v for k, v in VALVES.parameters.items()
                                              if "valve" not in k}, plant="muscle_pair")},
         "takes no command: give it one of [regulator_line], [valve_spool]"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_with_the_fix(given, words):
    with pytest.raises((ValueError, TypeError), match=re.escape(words)):
        RigEnv(**OPTIONS["joint"] | given)


def test_a_batch_says_that_it_has_no_goals():
    with pytest.raises(ValueError, match='vectorization_mode="sync"'):
        RigVectorEnv(2, goal=True, **OPTIONS["joint"])


@pytest.mark.parametrize("kind", ["steps", "ramps", "sine", "multisine"])
@pytest.mark.parametrize("rig", ["muscle_joint", "muscle_pair"])
def test_pressures_within_their_limits_hold_every_reference_of_an_arm(rig, kind):
    env = RigEnv(f"angle_{kind}", model=rig)
    first, *second = env.options.commands
    rest = Plant(rig).settle(*(each.low for each in second), regulator_voltage=first.high)
    highest = Plant(rig).observe(rest.state[None, :], rest.zero_contraction)["angle"][0]
    phase = env.task.schedule.phases[0]
    assert 0.6 * highest < phase.reference(phase.times).max() < highest


def test_a_station_refuses_the_task_of_a_rig():
    with pytest.raises(ValueError, match="make it with gym.make"):
        PMAEnv(tracking("contraction", np.sin))


def test_parameters_are_drawn_from_ranges_or_a_covariance():
    generator = np.random.default_rng(0)
    path, low, high = MOVED[0], 0.005, 0.009
    drawn = [Ranges({path: (low, high)})(JOINT, generator) for _ in range(50)]
    values = np.array([model.parameters["inertia"].inertia for model in drawn])
    assert low <= values.min() < low + 0.001 and high - 0.001 < values.max() <= high
    paths = (path, "joint_weight.moment_n_m")
    covariance = np.array([[4e-8, 3e-6], [3e-6, 1e-3]])
    assert Uncertainty((), [])(JOINT, generator) is JOINT
    models = [Uncertainty(paths, covariance.tolist())(JOINT, generator) for _ in range(2000)]
    pairs = np.array([[m.parameters["inertia"].inertia, m.parameters["joint_weight"].moment]
                      for m in models])  # fmt: skip
    np.testing.assert_allclose(np.cov(pairs.T), covariance, rtol=0.15)
    np.testing.assert_allclose(pairs.mean(axis=0), [0.0067, 0.3], rtol=0.02)
    env = RigVectorEnv(9, randomisation=Uncertainty(paths, covariance), **OPTIONS["joint"])
    env.reset(seed=1)
    assert len({env.member(i).plant.model.parameters["inertia"].inertia for i in range(9)}) == 9


@dataclass(frozen=True)
class Across:
    """A quarter of a turn, all the time."""

    def __call__(self, time):
        return 0.5 * np.pi + 0.0 * np.asarray(time)


@dataclass(frozen=True)
class Sine:
    """17 deg each way, at 0.5 Hz."""

    def __call__(self, time):
        return 0.3 * np.sin(np.pi * np.asarray(time))


@pytest.mark.campaign
def test_ppo_as_it_comes_learns_to_turn_a_pair_by_its_pressures():
    """0.17 deg rms on 2026-11-28 (seed 0); 17 deg is the sine's amplitude."""
    task, options = tracking("angle", Sine(), duration=8.0), {"model": "muscle_pair", "preview": 5}
    batch = SB3RigVecEnv(8, task, control_rate_hz=50.0, **options)
    policy = PPO("MlpPolicy", batch, n_steps=256, seed=0, device="cpu").learn(200_000)
    env = RigEnv(task, control_rate_hz=50.0, **options)
    seen, ended, errors = env.reset(seed=7)[0], False, []
    while not ended:
        seen, _, terminated, ended, info = env.step(policy.predict(seen, deterministic=True)[0])
        assert not terminated
        errors.append(info["angle_rad"] - info["reference_rad"])
    assert np.degrees(np.sqrt(np.mean(np.square(errors)))) < 1.0
