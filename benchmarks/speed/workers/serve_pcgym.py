"""PC-gym's stirred tank reactor, two states, as its documentation sets it up."""

# pyright: reportMissingImports=false
import numpy as np
from pcgym import make_env

from benchmarks.speed.loops import ACTIONS, Prepared, single

PACKAGES = ("pcgym", "casadi", "gymnasium", "numpy")

_STEPS = 120
_REACTOR = {
    "model": "cstr",
    "integration_method": "casadi",
    "N": _STEPS,
    "tsim": 26,
    "SP": {"Ca": [0.85] * (_STEPS // 2) + [0.9] * (_STEPS // 2)},
    "o_space": {"low": np.array([0.7, 300.0, 0.8]), "high": np.array([1.0, 350.0, 0.9])},
    "a_space": {"low": np.array([295.0]), "high": np.array([302.0])},
    "x0": np.array([0.8, 330.0, 0.8]),
}
"""An hour-scale batch: minutes, mol/l, K."""


def reactor() -> Prepared:
    """The reactor, cooled at random."""
    environment = make_env(_REACTOR)
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (ACTIONS, 1))
    return single(environment, list(actions))


ROWS = {"reactor": reactor}
