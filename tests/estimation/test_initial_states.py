"""Initial states that the readings of a trial say."""

from types import SimpleNamespace

import numpy as np

from pma_gym.data.trial import Trial
from pma_gym.estimation.initial_states import meet
from pma_gym.estimation.logged import Logged
from pma_gym.plant.model import load_model
from tests.discovery.rig_trials import FROZEN


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


def _logged(rows, seed):
    """A slide's trial, one reading of which is missing."""
    at, generator = np.arange(rows) / 100.0, np.random.default_rng(seed)
    readings = 1e-3 * generator.normal(size=rows)
    readings[rows // 2] = np.nan
    trial = Trial(at, {"load_command": np.zeros(rows)}, {"contraction": readings})
    return Logged.of(load_model(FROZEN / "driven_slide" / "model.toml"), 0, trial)


def test_trials_are_corrected_together_as_each_alone():
    """One of them runs away; the others do not mind."""
    generator = np.random.default_rng(7)
    logs = [_logged(rows, rows) for rows in (40, 55, 40)]
    spaces = [generator.normal(size=(6, len(logged.time), 3)) for logged in logs]
    spaces[1][-1] = 1e200
    held = [[space[:, :, k].copy() for k in range(len(logs[0].signals))] for space in spaces]
    levels = np.full(len(logs[0].signals), 1e-5)
    alone = [space.copy() for space in spaces]
    together = meet(spaces, held, logs, levels, 2)
    for space, here, logged, one, other in zip(alone, held, logs, together, spaces, strict=True):
        (correction,) = meet([space], [here], [logged], levels, 2)
        np.testing.assert_array_equal(correction.moves, one.moves)
        assert (correction.misfit, correction.rough) == (one.misfit, one.rough)
        np.testing.assert_array_equal(space, other)


def test_a_correction_leaves_what_no_start_explains():
    """It is a projection: beside the moved simulations the rest is nothing any more."""
    generator, logged = np.random.default_rng(8), _logged(60, 1)
    space = generator.normal(size=(3, 60, 3))
    held = [space[:, :, k].copy() for k in range(len(logged.signals))]
    moves = held[0][-2:] - held[0][0]
    meet([space], [held], [logged], np.full(len(logged.signals), 1e-5), 2)
    there = logged.there[0]
    left = logged.measured[0, there] - space[0, there, 0]
    moves = moves[:, there] - moves[:, there].mean(axis=1, keepdims=True)
    np.testing.assert_allclose(moves @ left, 0.0, atol=1e-9)
