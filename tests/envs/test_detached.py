"""What a controller receives holds no environment, and changing it changes no simulation."""

import copy
import gc
import pickle
import types

import numpy as np
import pytest

from pma_gym.engine.engine import Engine
from pma_gym.envs import Measurement, PMAEnv, Reference
from pma_gym.plant.plant import Plant
from pma_gym.tasks import following

TASKS = ["displacement", "isotonic_exercise"]
SHARED = (type, types.ModuleType, types.BuiltinFunctionType)
"""What is the same for the whole process; nothing of one episode is looked for behind it."""


def reachable(start):
    """Objects that lead from one to others by references, closures included."""
    known, waiting = {}, [start]
    while waiting:
        each = waiting.pop()
        if id(each) in known or isinstance(each, SHARED):
            continue
        known[id(each)] = each
        if isinstance(each, types.FunctionType):
            waiting += [cell.cell_contents for cell in each.__closure__ or ()]
        else:
            waiting += gc.get_referents(each)
    return list(known.values())


def made(task, **options):
    env = PMAEnv(task, pressure_kpa=500, **options)
    env.reset(seed=1)
    return env


@pytest.mark.parametrize("task", TASKS)
def test_nothing_that_a_controller_receives_leads_to_the_environment(task):
    env = made(task)
    for handed in (env.reference, env.station, env.measurement):
        reached = reachable(handed)
        assert not [each for each in reached if isinstance(each, PMAEnv | Engine | Plant)]
        assert not any(each is env.plant.model for each in reached)
    assert not hasattr(env.reference, "__self__") and not hasattr(env.reference, "__closure__")
    assert env.station.model == env.plant.model and env.station.model is not env.plant.model
    assert env.station.task == env.task and env.station.task is not env.task
    assert type(env.measurement) is Measurement and all(
        type(value) is float for value in env.measurement
    )


def test_a_reference_is_called_copied_and_pickled():
    env = made("displacement")
    assert isinstance(env.reference, Reference)
    assert env.reference(2.0) == pytest.approx(10e-3, abs=1e-12)
    for same in (copy.deepcopy(env.reference), pickle.loads(pickle.dumps(env.reference))):
        assert same == env.reference and same(2.0) == env.reference(2.0)
    station = pickle.loads(pickle.dumps(env.station))
    assert station == env.station == copy.deepcopy(env.station)


def vandalise(station, reference):
    """Overwrite all that a controller receives, by force."""
    rotor = station.model.parameters["rotor"]
    changed = dict(station.model.parameters) | {"rotor": rotor._replace(radius=1.0)}
    object.__setattr__(station.model, "parameters", changed)
    for schedule in (station.task.schedule, reference.schedule):
        object.__setattr__(schedule, "span", 1.0)
        for phase in schedule.phases:
            object.__setattr__(phase, "slope", 0.0)
    object.__setattr__(station.task, "load", 1.0)
    object.__setattr__(station, "period", 1.0)


def test_changing_what_a_controller_receives_changes_no_simulation():
    runs = []
    for by_force in (False, True):
        env = made("displacement")
        if by_force:
            vandalise(env.station, env.reference)
        rewards, done = [], False
        while not done:
            _, reward, terminated, truncated, info = env.step(env.action(2.0))
            rewards.append(reward)
            done = terminated or truncated
        env.reset(seed=2)
        runs.append((rewards, info, env.step(env.action(2.0))[1]))
        assert env.plant.model.parameters["rotor"].radius < 0.1
        assert env.station.model == env.plant.model
    assert runs[0] == runs[1]


class Uncopied:
    """A motion that cannot be copied."""

    def __call__(self, time):
        return 2e-3 * np.asarray(time)

    def __deepcopy__(self, memo):
        raise TypeError("no")


def test_a_motion_that_cannot_be_copied_serves_as_it_is():
    env = made(following("mine", "extension", Uncopied(), 2.0))
    assert env.reference(1.0) == env.station.task.schedule.at(1.0) == 2e-3
    assert env.station.task is not env.task
