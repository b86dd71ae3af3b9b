"""Where rows of this package find what differs between its versions.

A row whose part does not exist says so by `Missing` and is left out by name.
"""

from typing import Any

from benchmarks.speed.loops import Missing, Prepared


def right_hand_sides_per_step(environment: Any) -> float:  # noqa: ANN401 - single or vector
    """Evaluations of the right-hand side in a control step, a mean where steps differ.

    Args:
        environment: the environment that was measured, unwrapped.
    """
    # 100 internal steps of 0.1 ms, four stages each.
    return 400.0


def single_kernel(name: str) -> Prepared:
    """Whole control steps of one environment inside the compiled code, random actions.

    Args:
        name: the environment's id.
    """
    raise Missing("this version has no compiled control step")


def joint_fits(candidates: int, trials: int, seconds: float) -> Prepared:
    """Full joint fits of candidate models to trials, on two cores; a chunk is all of them.

    Args:
        candidates: number of models.
        trials: number of trials that each is fitted to.
        seconds: length of a trial (s).
    """
    raise Missing("this version has no fitting kernel")


def gpu(name: str, count: int, precision: str) -> Prepared:
    """Control steps on a CUDA device.

    Args:
        name: the environment's id.
        count: number of environments.
        precision: `float32` or `float64`.
    """
    raise Missing("no GPU here")
