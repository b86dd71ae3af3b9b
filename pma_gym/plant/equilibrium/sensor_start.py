"""Where the states of sensors begin: settled, or late behind an output that already moves."""

import numpy as np

from pma_gym.data.signals import SIGNALS
from pma_gym.effects.effect import Effect
from pma_gym.effects.ports import SENSOR_DELAY, measured_output
from pma_gym.plant.equilibrium.problem import EquilibriumProblem
from pma_gym.plant.rigs.rig import Rig


def start_sensors(problem: EquilibriumProblem, rig: Rig) -> None:
    """Set the states of delays and lags of sensors; the states of the rig must have been set."""
    late = [
        effect for effect in problem.plant.effects.values() if effect.port.startswith(SENSOR_DELAY)
    ]
    late = [effect for effect in late if effect.memory_names[0] in problem.names]
    for effect in late:
        problem.relax_memory(effect.port)
        if rig.is_free:
            _follow_motion(problem, effect, rig)
    for name in problem.names:
        if name.startswith("lag_"):
            problem.relax(name)
    for lag, rate in rig.moving_lags.items():
        if lag in problem.names:
            problem.follow(lag, problem[rate])


def _follow_motion(problem: EquilibriumProblem, effect: Effect, rig: Rig) -> None:
    """Put a delay where it is if the output has moved with constant acceleration before.

    The ladder is m' = L m + b u. For u' = v, v' = a it is at m = A u + B v + C a with L A = -b,
    L B = A and L C = B. At rest its even states are the output and the odd ones 0: that is A.
    """
    names = effect.memory_names
    _, speed = rig.start_paths
    moving = SIGNALS[measured_output(effect.port)].is_position
    rates = (problem[speed], problem.rate(speed)) if moving else (problem.rate(speed),)
    share = problem.parameters(effect.name)["share"]
    shape = np.outer(share * np.ones(len(problem.state)), np.arange(len(names)) % 2)
    slopes = problem.slopes(names)
    state = np.stack([problem[name] for name in names], axis=1)
    for rate in rates:
        shape = np.linalg.solve(slopes, shape[..., None])[..., 0]
        state += shape * rate[:, None]
    for i, name in enumerate(names):
        problem[name] = state[:, i]
