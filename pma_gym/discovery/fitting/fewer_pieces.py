"""Some of the pieces that long logs are cut into: enough to find where a fit should begin.

A search from many beginnings compares fits that are far from the trials. A few pieces of each file
tell those apart as well as all of them.
"""

from dataclasses import replace

import numpy as np

from pma_gym.discovery.fitting.fit_problem import FitProblem

PIECES = 8
"""How many pieces are kept, evenly over the logs; at least as many as there are files."""


def with_fewer_pieces(problem: FitProblem) -> FitProblem:
    """The same problem with at most half of its pieces; as it is where trials are whole, or few."""
    files = len(set(problem.files)) or len(problem.trials)
    count = max(PIECES, files)
    if 2 * count > len(problem.trials):
        return problem
    # In the middle of equal shares.
    edges = np.linspace(0.0, len(problem.trials), count + 1)
    taken = ((edges[:-1] + edges[1:]) / 2.0).astype(int).tolist()
    wholes = problem.wholes or tuple(range(len(problem.trials)))
    return replace(
        problem,
        trials=[problem.trials[place] for place in taken],
        files=tuple(problem.files[place] for place in taken),
        wholes=tuple(wholes[place] for place in taken),
    )
