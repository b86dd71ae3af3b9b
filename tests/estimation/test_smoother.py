"""The smoothed latent force: what all readings together say of it."""

import numpy as np
import pytest

from pma_gym import Plant
from pma_gym.data.trial import Trial
from pma_gym.estimation.smoother import smoothed
from tests.estimation.linear_slide import NOISES, begun, box, logged, matrices, point, slide


def exact(trial, made):
    """Transition, drift and covariance from each row to the next, by the matrix exponential."""
    load = trial.commands["load_command"]
    for k, span in enumerate(np.diff(trial.time)):
        phi, gamma, q = matrices(2.0, 0.1, span)
        yield phi[:4, :4], gamma[:4] * load[k], q[:4, :4]


def integrated(trial, made):
    """The same by the filter's own integration."""
    kept = made.kept(0, point(made))
    for k in range(1, len(trial.time)):
        phi = kept.transition[k]
        drift = kept.predicted[k] - phi @ kept.corrected[k - 1]
        yield phi, drift, kept.spread[k] - phi @ kept.certain[k - 1] @ phi.T


def conditioned(trial, ways):
    """Latent force and its deviation at all rows: one Gaussian of states after all readings."""
    count = len(trial.time)
    middle, across = np.zeros((count, 4)), np.zeros((count, 4, count, 4))
    mean, start = begun(trial, (0,), 2.0)
    middle[0], across[0, :, 0] = mean[:4], start[:4, :4]
    for k, (phi, drift, q) in enumerate(ways, start=1):
        middle[k] = phi @ middle[k - 1] + drift
        across[k] = np.einsum("ij,jkl->ikl", phi, across[k - 1])
        across[:, :, k] = np.einsum("kij,lj->kil", across[:, :, k - 1], phi)
        across[k, :, k] = phi @ across[k - 1, :, k - 1] @ phi.T + q
    known = np.isfinite(trial.measurements["contraction"])
    read = trial.measurements["contraction"][known]
    lag = across[known, 3][:, known, 3] + NOISES[0] ** 2 * np.eye(known.sum())
    gain = np.linalg.solve(lag, across[known, 3][:, :, 2]).T
    left = across[:, 2, :, 2] - gain @ across[known, 3][:, :, 2]
    return middle[:, 2] + gain @ (read - middle[known, 3]), np.sqrt(np.diag(left))


@pytest.mark.parametrize(("ways", "steps", "close"), [(exact, 1024, 5e-4), (integrated, 4, 1e-5)])
def test_the_smoothed_force_is_that_of_least_squares_over_all_readings(ways, steps, close):
    trial, _ = logged(rows=60, missing=True, uneven=True)
    made = box([trial], slide(), steps=steps)
    got = smoothed(made, point(made), 0)
    force, deviation = conditioned(trial, ways(trial, made))
    np.testing.assert_allclose(got.force, force, atol=close * np.abs(force).max(), rtol=0.0)
    np.testing.assert_allclose(got.deviation, deviation, rtol=close)


def test_a_hidden_sine_is_seen_within_its_band():
    fine = np.arange(0.0, 4.0, 0.001)
    hidden = 3.0 * np.sin(2 * np.pi * 0.8 * fine)
    load = 20.0 * np.cos(2 * np.pi * 0.5 * fine)
    # The load pulls out, and the latent force in.
    both = Trial(fine, {"load_command": load - hidden})
    truth = Plant(slide()).simulate(both, noise=False)
    noise = NOISES[0] * np.random.default_rng(4).standard_normal(400)
    read = {"contraction": truth.measurements["contraction"][::10] + noise}
    made = box([Trial(fine[::10], {"load_command": load[::10]}, read)], slide(), linear=True)
    got = smoothed(made, point(made, memory=0.3), 0)
    off = got.force - hidden[::10]
    assert np.abs(off / got.deviation).max() < 3.0
    assert np.mean(np.abs(off) < 1.96 * got.deviation) > 0.9
    # The band is narrower than the force is large, but at the ends.
    assert got.deviation[20:-20].max() < 1.0 and np.std(off) < 0.5
    assert got.deviation[-1] > 1.5 * np.median(got.deviation)
    # The sensor lags by 5 ms, which is 2 mm; the position does not.
    prompt = Plant(slide(bandwidth=1e4)).simulate(both, noise=False).measurements["contraction"]
    assert np.abs(got.position - prompt[::10]).max() < 1e-4
