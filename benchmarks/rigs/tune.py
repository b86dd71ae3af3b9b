"""Settings of controllers for a rig, by a search on its environment."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.optimize import minimize

from benchmarks.rigs.score import run_episode
from controllers.rigs import RIG_CONTROLLERS
from pma_gym.envs import RigEnv

EVALUATIONS = 90
"""Trials of settings in a search."""

MOVE_WEIGHT = 5.0
"""Percent of the range that a mean change of the action by 1 in a step costs."""

STARTS = (1.0, 0.1, 10.0)
"""Factors on all settings where the search looks first."""

SEED = 1000
"""Of the first episode; comparisons use seeds below."""


def tuned(
    name: str,
    options: Mapping[str, Any],
    tasks: Sequence[str],
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> dict[str, float]:
    """Best settings of a controller: least mean error on the tasks, with little moving.

    Nelder-Mead on their logarithms, from the best of some starts.

    Args:
        name: of the controller.
        options: of the environment, whose randomisation makes the settings robust.
        tasks: names of tasks.
        on_progress: called with the trials made and their number.
    """
    kind = RIG_CONTROLLERS[name]
    if not kind.settings:
        return {}
    environments = [RigEnv(task, **options) for task in tasks]
    names, made = list(kind.settings), 0

    def cost(logarithms: np.ndarray) -> float:
        nonlocal made
        made += 1
        on_progress(min(made, EVALUATIONS), EVALUATIONS)
        settings = dict(zip(names, np.exp(logarithms).tolist(), strict=True))
        total = 0.0
        for at, env in enumerate(environments):
            try:
                info, moved, _ = run_episode(env, kind(settings), SEED + at)
            except np.linalg.LinAlgError:
                return 1e3
            total += float(info["percent_of_range"]) + MOVE_WEIGHT * moved
        return total / len(environments)

    first = np.log([kind.settings[each] for each in names])
    start = min((first + np.log(factor) for factor in STARTS), key=cost)
    minimum = minimize(
        cost,
        start,
        method="Nelder-Mead",
        options={
            "maxfev": EVALUATIONS - len(STARTS),
            "initial_simplex": np.vstack([start, start + 0.7 * np.eye(len(start))]),
            "xatol": 0.03,
            "fatol": 1e-3,
        },
    )
    return {each: float(f"{v:.4g}") for each, v in zip(names, np.exp(minimum.x), strict=True)}
