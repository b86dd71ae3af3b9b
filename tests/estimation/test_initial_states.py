"""Initial states that the readings of a trial say."""

from types import SimpleNamespace

import numpy as np

from pma_gym.estimation.initial_states import meet


def test_a_simulation_that_runs_away_stays_as_it_is():
    """Its squares are beyond what a number holds; nobody is warned of that."""
    states = np.zeros((3, 4, 2))
    held = np.zeros((3, 4))
    held[-2:] = 1e200
    logged = SimpleNamespace(
        channels=[0],
        there=[slice(None)],
        signals=[SimpleNamespace(has_free_zero=False)],
        measured=np.ones((1, 4)),
        time=np.arange(4.0),
    )
    meet([states], [[held]], [logged], np.ones(1), 2)
    assert not states.any()
