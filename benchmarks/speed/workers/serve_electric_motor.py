"""gym-electric-motor: drives with their converter, one ODE step every 1e-4 s."""

# pyright: reportMissingImports=false
import gym_electric_motor

from benchmarks.speed.loops import ACTIONS, Prepared, single

PACKAGES = ("gym-electric-motor", "gymnasium", "numpy", "scipy")


def one(name: str) -> Prepared:
    """A drive with its default converter, load, reference and solver."""
    environment = gym_electric_motor.make(name)
    environment.action_space.seed(0)
    return single(environment, [environment.action_space.sample() for _ in range(ACTIONS)])


ROWS = {"one": one}
