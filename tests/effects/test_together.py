"""Effects at their usual values, many at once: rests, environments, equations."""

import numpy as np
import pytest

from pma_gym.effects import CATALOGUE
from pma_gym.envs import PMAEnv, PMAVectorEnv
from pma_gym.plant.equilibrium.solver import equilibria_at
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant

MANY = (
    *("nonlinear_stiffness", "warm_up", "drive_delay", "regulator_delay", "regulator_deadband"),
    *("bearing_friction", "potentiometer_backlash"),
)


@pytest.fixture(scope="module")
def model():
    usual = {name: CATALOGUE[name].values_in_files(CATALOGUE[name].usual) for name in MANY}
    return load_model("station").with_effects(usual)


def test_many_rest_as_one_does(model):
    plant = Plant(model)
    regulator = np.array([plant.regulator_voltage(p) for p in (200e3, 300e3, 500e3)])
    motor = np.array([0.0, 2.0, 4.0])
    states, zero = equilibria_at(plant, motor, regulator)
    for i in range(3):
        alone = plant.settle(motor[i], regulator_voltage=regulator[i])
        np.testing.assert_array_equal(alone.state, states[i])
        assert np.abs(plant.derivative(states[i], motor[i], regulator[i], zero[i])).max() < 1e-7


def test_many_environments_have_the_bits_of_one(model):
    env, many = PMAEnv(model=model), PMAVectorEnv(3, model=model)
    observation, _ = env.reset(seed=3)
    observations, _ = many.reset(seed=3)
    np.testing.assert_array_equal(observation, observations[0])
    draw = np.random.default_rng(0)
    for _ in range(100):
        action = draw.uniform(-1.0, 1.0, env.action_space.shape).astype(np.float32)
        observation, reward, *_ = env.step(action)
        observations, rewards, *_ = many.step(np.stack([action] * 3))
        np.testing.assert_array_equal(observation, observations[0])
        assert reward == rewards[0]
