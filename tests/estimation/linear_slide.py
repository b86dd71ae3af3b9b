"""A slide without dry friction, by the matrix exponential: the package's filter is not in it."""

from functools import cache

import numpy as np
from scipy.linalg import block_diag, expm

from pma_gym.data.trial import Trial
from pma_gym.effects import CATALOGUE
from pma_gym.estimation.innovations import GreyBox, Point, Rows
from pma_gym.estimation.logged import Logged
from pma_gym.plant.model import Model

MASS_KG, DAMPING, BANDWIDTH_HZ = 5.0, 50.0, 30.0
NOISES = (1e-5, 2e-3)
"""Of position (m) and speed (m/s)."""


def slide(mass=MASS_KG, bandwidth=BANDWIDTH_HZ, speed=False, **tables):
    """A slide with viscous damping, a position sensor and perhaps one of speed."""
    known = {
        "two_way_drive": {"gain_n_per_v": 100.0, "middle_v": 5.0},
        "slide": {"mass_kg": mass},
        "symmetric_damping": {
            "intercept_n_s_per_mm": 1e-3 * DAMPING,
            "slope_n_s_per_mm_per_kpa": 0.0,
        },
        **tables,
        "start": {"contraction_mm": 0.0, "velocity_mm_per_s": 0.0},
        "lvdt": {"bandwidth_hz": bandwidth, "noise_mm": 1e3 * NOISES[0]},
    }
    if speed:
        known["tachometer"] = {"bandwidth_hz": bandwidth, "noise_mm_per_s": 1e3 * NOISES[1]}
    return Model("slide", "A slide", "slide", {n: CATALOGUE[n].parse(t) for n, t in known.items()})


@cache
def matrices(force, memory, span):
    """Transition, input, process covariance over a time; of position, speed, force, two lags."""
    lag = 2.0 * np.pi * BANDWIDTH_HZ
    a = np.zeros((6, 6))
    a[0, 1] = 1.0
    a[1, [1, 2, 5]] = np.array([-DAMPING, 1.0, -1.0]) / MASS_KG
    a[2, 2] = -1.0 / memory
    a[3, [0, 3]] = a[4, [1, 4]] = lag, -lag
    whole = expm(a * span)
    # C. Van Loan 1978: the covariance by one exponential of twice the size.
    noise = np.zeros((5, 5))
    noise[2, 2] = 2.0 * force**2 / memory
    both = np.block([[-a[:5, :5], noise], [np.zeros((5, 5)), a[:5, :5].T]])
    block = expm(both * span)
    return whole[:5, :5], whole[:5, 5], block[5:, 5:].T @ block[:5, 5:]


def logged(seed=0, rows=200, rate=100.0, force=2.0, memory=0.1, missing=False, uneven=False):
    """A trial under a held random load (N) and a latent force."""
    generator = np.random.default_rng(seed)
    spans = np.full(rows - 1, 1.0 / rate)
    if uneven:
        spans *= generator.uniform(0.5, 1.5, rows - 1)
    time = np.concatenate([[0.0], np.cumsum(spans)])
    load = np.repeat(generator.uniform(-20.0, 20.0, rows // 10 + 1), 10)[:rows]
    state = np.array([0.0, 0.05, force * generator.standard_normal(), 0.0, 0.05])
    states = [state]
    for k, span in enumerate(spans):
        phi, gamma, q = matrices(force, memory, span)
        state = phi @ state + gamma * load[k]
        state = state + generator.multivariate_normal(np.zeros(5), q, method="eigh")
        states.append(state)
    states = np.array(states)
    read = states[:, 3:] + np.array(NOISES) * generator.standard_normal((rows, 2))
    if missing:
        read[generator.uniform(size=read.shape) < 0.2] = np.nan
    measured = {"contraction": read[:, 0], "velocity": read[:, 1]}
    return Trial(time, {"load_command": load}, measured), states


def box(trials, model, channels=(0,), steps=4, linear=False):
    """The package's filter over trials."""
    every = [Logged.of(model, i, trial) for i, trial in enumerate(trials)]
    return GreyBox(model, [Rows(one, channels, steps, linear, 1) for one in every], channels)


def point(made, force=2.0, memory=0.1, **numbers):
    """The model's own numbers with some noise and latent force."""
    noises = tuple(NOISES[channel] for channel in made.channels)
    known = {**made.numbers(), **numbers}
    return Point(known, noises, (force,) * len(made.rows), memory)


def begun(trial, channels, force):
    """Mean and covariance before the first reading: what the first eight readings say, widely."""
    y = trial.measurements["contraction"]
    there = np.flatnonzero(np.isfinite(y))[:8]
    first, t = y[there[0]], trial.time[there]
    speed, spread = (
        np.polyfit(t - t[0], y[there], 1)[0],
        (np.ptp(y[there]) + 1e-12) / (t[-1] - t[0]),
    )
    if 1 in channels:
        v = trial.measurements["velocity"]
        v = v[np.isfinite(v)][:8]
        speed, spread = v[0], np.std(v) + 1e-12
    deviations = [2.0 * NOISES[0], spread, force, 2.0 * NOISES[0], spread]
    return np.array([first, speed, 0.0, first, speed]), np.diag(np.square(deviations))


def kalman(trial, channels, force=2.0, memory=0.1, colour=0.0, fades=1.0):
    """Innovations, their variances (rows, signals) and the log likelihood."""
    mean, p = begun(trial, channels, force)
    mean, p = np.append(mean, 0.0), block_diag(p, colour**2)
    read = np.stack([trial.measurements[n] for n in ("contraction", "velocity")], axis=1)
    errors, spreads = np.empty((2, len(trial.time), len(channels)))
    total = 0.0
    for k in range(len(trial.time)):
        if k:
            phi, gamma, q = matrices(force, memory, trial.time[k] - trial.time[k - 1])
            kept = np.exp(-(trial.time[k] - trial.time[k - 1]) / fades)
            phi, q = block_diag(phi, kept), block_diag(q, colour**2 * (1.0 - kept**2))
            mean = phi @ mean + np.append(gamma, 0.0) * trial.commands["load_command"][k - 1]
            p = phi @ p @ phi.T + q
        for i, channel in enumerate(channels):
            h = np.eye(6)[3 + channel] + np.eye(6)[5] * (i == 0)
            s = h @ p @ h + NOISES[channel] ** 2
            e = read[k, channel] - h @ mean
            errors[k, i], spreads[k, i] = e, s
            if np.isfinite(e):
                mean, p = mean + p @ h / s * e, p - np.outer(p @ h, h @ p) / s
                total -= 0.5 * (e**2 / s + np.log(s))
    return errors, spreads, total
