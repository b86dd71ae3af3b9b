"""What every controller of the registry keeps: its name, its voltages, its copies."""

import copy
import math
import pickle

import numpy as np
import pytest

from controllers import CONTROLLERS, Controller, adrc, ilc, lqg, sliding_mode
from pma_gym.envs import PMAEnv

EXERCISE = "isotonic_exercise"
BEFORE, AFTER = 120, 60
"""Control steps before the copy and after it."""


def task_for(name):
    """A task that a controller can do."""
    for task in ("displacement", "isotonic", EXERCISE, "isokinetic_exercise"):
        env = PMAEnv(task, pressure_kpa=500 if "exercise" in task else 300)
        env.reset(seed=1)
        try:
            CONTROLLERS[name]().reset(env.reference, env.station)
        except ValueError as error:
            if "shown" in str(error):
                return task
            continue
        return task
    raise AssertionError(f"{name} does no task")


@pytest.mark.parametrize("name", CONTROLLERS)
def test_it_has_the_name_of_its_row_and_a_line_that_says_what_it_does(name):
    controller = CONTROLLERS[name]()
    assert isinstance(controller, Controller) and controller.name == name
    assert (type(controller).__doc__ or "").strip()


@pytest.mark.parametrize("name", CONTROLLERS)
def test_its_voltages_are_numbers_and_a_reset_begins_anew(name):
    controller, env, runs = CONTROLLERS[name](), PMAEnv(task_for(name), pressure_kpa=500), []
    if getattr(controller, "repetitions", 1) > 1:
        pytest.skip("learns from trial to trial: its second trial differs on purpose")
    for _ in range(2):
        env.reset(seed=5)
        if hasattr(controller, "receive"):
            controller.receive(env)
        controller.reset(env.reference, env.station)
        volts = []
        for _ in range(3 if hasattr(controller, "receive") else AFTER):
            volts.append(float(controller.act(env.measurement, env.time)))
            env.step(env.action(volts[-1]))
        runs.append(volts)
    assert all(math.isfinite(value) and 0.0 <= value <= 10.0 for value in runs[0])
    assert runs[0] == runs[1]


@pytest.mark.parametrize("name", CONTROLLERS)
def test_a_copy_in_the_middle_of_a_trial_goes_on_alike_and_alone(name):
    env, controller = PMAEnv(task_for(name), pressure_kpa=500), CONTROLLERS[name]()
    env.reset(seed=3)
    if hasattr(controller, "receive"):
        controller.receive(env)
    controller.reset(env.reference, env.station)
    for _ in range(BEFORE):
        env.step(env.action(controller.act(env.measurement, env.time)))
    copied = copy.deepcopy(controller)
    readings, given = [], []
    for _ in range(1 if hasattr(controller, "receive") else AFTER):
        readings.append((env.measurement, env.time))
        given.append(float(controller.act(*readings[-1])))
        if not hasattr(controller, "receive"):
            env.step(env.action(given[-1]))
    # The original has gone on by now; its copy stands where it was made.
    assert [float(copied.act(*reading)) for reading in readings] == given


@pytest.mark.parametrize("module", [adrc, ilc, lqg, sliding_mode])
def test_defaults_lie_within_the_bounds_of_a_search(module):
    for settings in module.DEFAULTS.values():
        for name, (low, high) in module.BOUNDS.items():
            assert low <= getattr(settings, name) <= high


def test_a_copy_of_a_program_that_met_its_limits_goes_on_with_the_same_bits():
    from controllers.design.quadratic_program import BoundedProgram

    program, generator = BoundedProgram(3), np.random.default_rng(5)

    def problem():
        root = generator.normal(size=(3, 3))
        low = np.full(3, -0.1)
        return root @ root.T + np.eye(3), 5.0 * generator.normal(size=3), low, -low

    for _ in range(20):
        program.solve(*problem())
    assert program.limited == 20
    copies = [copy.deepcopy(program), pickle.loads(pickle.dumps(program))]
    for asked in [problem() for _ in range(20)]:
        answer = program.solve(*asked)
        assert all(np.array_equal(copied.solve(*asked), answer) for copied in copies)
    assert copies[0].limited == 40
