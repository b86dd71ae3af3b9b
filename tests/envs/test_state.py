"""States as values: taken, kept as text, put back; what does not fit is refused with its name."""

import base64
import json
import pickle

import numpy as np
import pytest
from gymnasium.error import ResetNeeded

from pma_gym.envs import EnvState, PMAEnv, PMAVectorEnv, StateError
from pma_gym.plant.model import load_model
from pma_gym.tasks import following


def kept(state):
    """A state through both forms in which it is kept."""
    return pickle.loads(pickle.dumps(EnvState.from_json(state.to_json())))


def test_an_environment_goes_on_from_its_state(options, single, course, same):
    env = single(options)
    env.reset(seed=3)
    course(env, 9)
    state = kept(env.get_state())
    assert state == env.get_state()
    ahead, path, summary = course(env, 90), env.trajectory(), env.episode_summary()
    plant, seed = env.plant.model, env.np_random_seed
    draws = env.np_random.random(3)
    # Into itself, and into one that has been elsewhere.
    other = single(options)
    other.reset(seed=8)
    course(other, 20)
    for one in (env, other):
        one.set_state(state)
        assert one.get_state() == state
        assert same(course(one, 90), ahead)
        np.testing.assert_array_equal(one.trajectory(), path)
        assert same(one.episode_summary(), summary)
        assert one.plant.model == plant and one.np_random_seed == seed
        np.testing.assert_array_equal(one.np_random.random(3), draws)


def test_states_before_and_after_episodes(single, same):
    env, other = single({}), single({})
    waiting = env.get_state()
    other.reset(seed=1)
    other.set_state(waiting)
    with pytest.raises(ResetNeeded, match="no episode has begun"):
        other.step([0.0])
    assert other._np_random is None
    env.reset(seed=4)
    begun = env.get_state()
    while env._idle is None:
        env.step([-0.8])
    ended = env.get_state()
    assert same(other.reset(seed=4)[0], single({}).reset(seed=4)[0])
    other.set_state(ended)
    with pytest.raises(ResetNeeded, match=r"the episode ended at 5\.\d+ s"):
        other.step([0.0])
    assert same(other.episode_summary(), env.episode_summary())
    assert same(other.reset(), env.reset())
    # Back from an end to the beginning.
    env.set_state(begun)
    assert env.time == 0.0 and env.ended_by == ""
    env.step([0.0])


def test_a_limit_that_ended_an_episode_is_kept(fragile):
    env = PMAEnv("displacement", model=fragile, pressure_kpa=300.0)
    env.reset(seed=1)
    while env._idle is None:
        env.step([1.0])
    assert env.ended_by
    other = PMAEnv("displacement", model=fragile, pressure_kpa=300.0)
    other.set_state(EnvState.from_json(env.get_state().to_json()))
    assert other.ended_by == env.ended_by


def test_a_seeded_environment_keeps_its_seed_before_an_episode(single, same):
    """A reset that fails leaves the seed, not an episode."""
    env = single({})
    env.reset(seed=9)
    with pytest.raises(ValueError, match="pressure_kpa"):
        env.reset(options={"pressure_kpa": 1.0})
    other = single({})
    other.set_state(env.get_state())
    assert same(other.reset(), env.reset())


def test_states_are_immutable_and_share_nothing(single, course):
    env = single({})
    env.reset(seed=1)
    state = env.get_state()
    text = state.to_json()
    course(env, 20)
    assert state.to_json() == text
    assert all(isinstance(part, bytes) for part in state.simulation[:-1])
    with pytest.raises(AttributeError):
        state.begun = b""
    assert len({state, EnvState.from_json(text), env.get_state()}) == 2


def test_a_batch_goes_on_from_its_state(batch_options, batch_course, same):
    made = batch_options | {"randomisation": "varied"}
    envs = PMAVectorEnv(17, **made)
    # How many threads there are decides nothing.
    other = PMAVectorEnv(17, **(made | {"threads": 2}))
    waiting = kept(envs.get_state())
    envs.reset(seed=3)
    for steps in (0, 45):
        batch_course(envs, steps)
        state = kept(envs.get_state())
        ahead, seed = batch_course(envs, 15), envs.np_random_seed
        for one in (other, envs):
            one.set_state(state)
            assert one.get_state() == state
            assert same(batch_course(one, 15), ahead)
            assert one.np_random_seed == seed
            models = [model.parameters for model in one.engine.models]
            assert models == [model.parameters for model in envs.engine.models]
    other.set_state(waiting)
    with pytest.raises(ResetNeeded, match="no episode has begun"):
        other.step(np.zeros((17, 1)))
    for one in (envs, other):
        one.close()


def test_a_batch_looks_ahead_from_where_one_environment_is(course, same):
    made = {"model": "station", "randomisation": "varied", "control_rate_hz": 10.0}
    env = PMAEnv("displacement", **made)
    envs = PMAVectorEnv(6, "displacement", autoreset_mode="Disabled", threads=2, **made)
    env.reset(seed=1)
    course(env, 5)
    state = env.get_state()
    envs.set_state(state)
    volts = np.linspace(-1.0, 1.0, 6)
    observations, rewards, *_ = envs.step(volts[:, None])
    for i, action in enumerate(volts):
        env.set_state(state)
        seen = env.step([action])
        assert same(seen[0], observations[i]) and seen[1] == rewards[i]
    with pytest.raises(StateError, match=r"environment: precision is double there and single here"):
        PMAVectorEnv(2, "displacement", precision="single", **made).set_state(state)


def as_given(nominal, generator):
    """No randomisation, by a function."""
    return nominal


CHANGES = [
    ({"task": "rotation"}, r"task is displacement there and rotation here; make this one"),
    ({"reward": "smooth", "preview": 2}, r"preview is 0\.0 there.*, reward is absolute there"),
    ({"pressure_kpa": [300, 350]}, r"pressure_kpa is 300\.0 there and \[300\.0, 350\.0\] here"),
    ({"randomisation": as_given}, "randomisation is none there and <function as_given> here"),
    ({"disturbances": "regulator"}, "disturbances is none there and regulator here"),
    ({"model": "station"}, r"model\..* there and .* here.* more; make this one"),
    (
        {"model": load_model("serres2008").replace({"slide.mass_kg": 0.75})},
        r"model\.slide\.mass_kg is 0\.5 there and 0\.75 here; make",
    ),
    (
        {"task": following("displacement", "extension", lambda time: 1e-3 * time, 5.0, 25e-3)},
        r"task\.reference is displacement [0-9a-f]+ there and displacement [0-9a-f]+ here",
    ),
]


@pytest.mark.parametrize(("change", "words"), CHANGES, ids=lambda value: str(value)[:40])
def test_a_state_of_another_environment_is_refused_by_what_differs(change, words, single):
    env, other = single({}), single(change)
    env.reset(seed=1)
    other.reset(seed=1)
    before = other.get_state()
    with pytest.raises(StateError, match=rf"^the state belongs to another environment: .*{words}"):
        other.set_state(env.get_state())
    assert other.get_state() == before


def test_operators_and_batches_differ_too():
    made = {"model": "station", "pressure_kpa": 400.0}
    one = PMAEnv("isokinetic_exercise", operator="typical", **made)
    with pytest.raises(StateError, match="operator is typical there and random here"):
        PMAEnv("isokinetic_exercise", **made).set_state(one.get_state())
    envs = PMAVectorEnv(2, autoreset_mode="SameStep")
    with pytest.raises(StateError, match=r"num_envs is 2 there and 3 here, autoreset_mode is Same"):
        PMAVectorEnv(3).set_state(envs.get_state())
    with pytest.raises(StateError, match="num_envs is 2 there and a PMAEnv here; make"):
        PMAEnv().set_state(envs.get_state())
    many = PMAVectorEnv(2, pressures_kpa=[200, 300])
    with pytest.raises(StateError, match=r"pressures_kpa is \[200\.0, 300\.0\] there and \[200"):
        PMAVectorEnv(2, pressures_kpa=[200, 400]).set_state(many.get_state())


def test_what_reads_the_same_is_the_same(single, course, same):
    first = single({"pressure_kpa": [300, 350], "model": "serres2008"})
    second = single({"pressure_kpa": (300.0, 350.0), "model": load_model("serres2008")})
    first.reset(seed=1)
    second.set_state(first.get_state())
    assert same(course(second), course(first))


@pytest.mark.parametrize("given", [None, 3, {}, "state", (1, 2)])
def test_what_is_no_state_is_refused(given, single):
    for env in (single({}), PMAVectorEnv(2)):
        with pytest.raises(TypeError, match=r"set_state takes what get_state\(\) gave"):
            env.set_state(given)


def damaged(state, name, change):
    return state._replace(simulation=state.simulation._replace(**{name: change}))


@pytest.mark.parametrize("count", [0, 5])
def test_damaged_states_are_refused_and_change_nothing(count):
    options = {"model": "serres2008", "control_rate_hz": 10.0, "randomisation": "varied"}
    env = PMAVectorEnv(count, **options) if count else PMAEnv("displacement", **options)
    env.reset(seed=1)
    for _ in range(7):
        env.step(np.zeros(env.action_space.shape))
    before = env.get_state()
    numbers = np.frombuffer(before.simulation.numbers).reshape(max(count, 1), -1)
    engine = env.engine if count else env._engine
    offsets = engine.state_layout.offsets
    bad = []
    for name, values in {
        "count": [-1, 10**6, 2**62],
        "key_0": [-1, 2**32],
        "episode": [-2, -(2**60)],
        "sample": [-1.0, np.nan, np.inf, 1e6],
        "size": [-1.0, np.nan],
    }.items():
        for value in values:
            changed = numbers.copy()
            column = changed.view(np.int64) if isinstance(value, int) else changed
            column[-1, offsets[name]] = value
            bad.append(damaged(before, "numbers", changed.tobytes()))
    for name in before.simulation._fields[:-1]:
        data = getattr(before.simulation, name)
        bad += [damaged(before, name, data[:-1] if data else b"x"), damaged(before, name, None)]
    model = before.simulation.models[-1]
    other = model.with_effects({"hanging_load": {}})
    for last in (3, other):
        bad.append(damaged(before, "models", (*before.simulation.models[:-1], last)))
    bad.append(damaged(before, "models", ()))
    bad += [before._replace(begun=b""), before._replace(ended=None), before._replace(seeds=(-1,))]
    bad += [before._replace(generator=(1, 2, 3, 4)), before._replace(ended_by=3)]
    for state in bad:
        with pytest.raises(StateError):
            env.set_state(state)
        assert env.get_state() == before
    env.step(np.zeros(env.action_space.shape))


def test_text_that_is_no_state_is_refused(single):
    env = single({"randomisation": "varied", "model": "station"})
    env.reset(seed=1)
    text = env.get_state().to_json()
    cases = ["", "{", "[" * 100_000, "3", "{}", text[:-1], text.replace("state 1", "state 9")]
    cases += [text.replace('"numbers": "', '"numbers": "*'), text.replace('"seeds"', '"seed"')]
    cases += [text.replace('"slide"', '"__import__"'), text.replace('"mass"', '"mess"')]
    cases += ["9" * 5000, b"\xff", None]
    for case in cases:
        with pytest.raises(StateError):
            EnvState.from_json(case)
    document = json.loads(text)
    for value in (1e999, -1.0, "0.5", None, 10**400, [0.5]):
        document["simulation"]["models"][0]["parameters"]["slide"]["mass"] = value
        with pytest.raises(StateError, match=r"slide\.mass_kg of a drawn station must lie in"):
            EnvState.from_json(json.dumps(document))


@pytest.mark.parametrize("kind", ["single", "batch"])
def test_states_with_any_bytes_changed_are_refused_or_run(kind, single):
    """A state from a stranger is data: whatever its numbers, no step leaves its arrays."""
    options = {"disturbances": "regulator_and_hand_push", "control_rate_hz": 10.0}
    env = single(options) if kind == "single" else PMAVectorEnv(3, **options)
    env.reset(seed=1)
    for _ in range(5):
        env.step(np.zeros(env.action_space.shape))
    text, generator = env.get_state().to_json(), np.random.default_rng(1)
    refused = 0
    for _ in range(120):
        document = json.loads(text)
        name = str(generator.choice(["numbers", "pressures", "observations", "rewards", "flags"]))
        data = bytearray(base64.b64decode(document["simulation"][name]))
        for _ in range(generator.integers(1, 4)):
            data[generator.integers(len(data))] = generator.integers(256)
        document["simulation"][name] = base64.b64encode(data).decode()
        try:
            env.set_state(EnvState.from_json(json.dumps(document)))
        except StateError:
            refused += 1
            continue
        for _ in range(2):
            if kind == "batch" or env._idle is None:
                env.step(np.zeros(env.action_space.shape))
    assert 0 < refused < 100
