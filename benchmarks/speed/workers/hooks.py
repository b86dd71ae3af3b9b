"""Functions that differ between versions of this package, for its rows.

A row whose part does not exist says so by `Missing` and is left out by name.
"""

import ctypes
from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np

from benchmarks.speed.loops import ACTIONS, Prepared
from benchmarks.speed.rows import EVALUATIONS
from pma_gym.plant.plant import Plant

if TYPE_CHECKING:
    # Earlier versions, which it measures too, have it elsewhere.
    from pma_gym.engine.engine import Engine

WATCHED = 64
"""Control steps over which evaluations are counted, fewer of large batches."""

_counted: dict[int, float] = {}


def right_hand_sides_per_step(environment: Any) -> float:  # noqa: ANN401 - single or vector
    """Evaluations of the right-hand side in a control step: a mean, for steps differ.

    Counted while the environment goes on under random actions; idle lanes of a register count.

    Args:
        environment: the environment that was measured, unwrapped.
    """
    engine: Engine = getattr(environment, "engine", None) or environment._engine
    if id(engine) not in _counted:
        generator, attempts = np.random.default_rng(1), 0
        shape, watched = environment.action_space.shape, max(2, min(WATCHED, 65536 // engine.count))
        environment.reset()
        for _ in range(watched):
            environment.step(generator.uniform(-1.0, 1.0, shape).astype(np.float32))
            attempts += engine.attempts
        environment.reset()
        each = EVALUATIONS * attempts * engine.width / (watched * engine.count)
        _counted[id(engine)] = each
    return _counted[id(engine)]


def single_kernel(name: str) -> Prepared:
    """Whole control steps of one environment inside the compiled code, random actions.

    Args:
        name: the environment's id.
    """
    environment: Any = gym.make(name).unwrapped
    environment.reset(seed=0)
    engine: Engine = environment._engine
    functions = engine.kernel.library
    check, run = (
        functions.function(name, [ctypes.c_void_p], ctypes.c_int64) for name in ("check", "step")
    )
    arguments = engine._address
    entry = memoryview(engine.actions[0])
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, ACTIONS).tolist()

    def chunk() -> int:
        for action in actions:
            entry[0] = action
            if check(arguments) or run(arguments):
                environment.reset()
        return len(actions)

    return Prepared(chunk)


def joint_fits(candidates: int, trials: int, seconds: float) -> Prepared:
    """Full joint fits of candidate models to trials, on two cores; a chunk is all of them.

    Args:
        candidates: number of models.
        trials: number of trials that each is fitted to.
        seconds: length of a trial (s).
    """
    from benchmarks.speed import fits

    models = fits.CANDIDATES[:candidates]
    for candidate in models:
        Plant(candidate.model())
    logged = fits.trials(trials, seconds)

    def chunk() -> int:
        for candidate in models:
            fits.fit(candidate.model(), logged, candidate.free, threads=fits.THREADS)
        return 1

    return Prepared(chunk)
