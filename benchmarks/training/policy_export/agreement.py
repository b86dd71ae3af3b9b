"""Agreement of two computations of a network up to float32 rounding."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from controllers.policies.network import Network, Weights
from pma_gym.engine.observation import BOUND

AGREEMENT = 1e-6
"""Largest difference of two actions of -1 to 1 (5 uV of 0-10 V), but for rounding."""

ROUNDINGS = 4.0
"""Frameworks sum in other orders: as many times NumPy's own rounding in float32 is allowed."""

LARGEST = 1e-3
"""Largest difference that is put down to rounding: 5 mV of 0-10 V."""

OBSERVATIONS = 512
"""How many observations are tried."""


class ExportError(ValueError):
    """A model that cannot be exported; the message says why and the fix."""


def check_agreement(
    what: str, weights: Weights, actions: Callable[[NDArray[np.float32]], NDArray[np.floating]]
) -> float:
    """Refuse a network whose actions are not those of another computation of it.

    Args:
        what: the other computation, in words.
        weights: the network.
        actions: the other one's actions for observations of shape (count, inputs).
    Returns:
        The largest difference of an action.
    Raises:
        ExportError: they differ by more than 1e-6 and what rounding in float32 explains: that
            alone makes 1e-5 of large weights.
    """
    rows = drawn_observations(weights.sizes[0])
    ours = Network(weights).many(rows)
    theirs = np.asarray(actions(rows), np.float64).reshape(ours.shape)
    difference = float(np.max(np.abs(theirs - ours)))
    rounding = float(np.max(np.abs(_in_float32(weights, rows) - ours)))
    allowed = min(AGREEMENT + ROUNDINGS * rounding, LARGEST)
    # `not <=`: NaN agrees with nothing.
    if not difference <= allowed:
        raise ExportError(
            f"the exported network and {what} must agree to {allowed:.1e} on {len(rows)} drawn "
            f"observations, they differ by {difference:.1e}: the model computes something that a "
            "policy file does not have; train it as a plain MlpPolicy"
        )
    return difference


def drawn_observations(entries: int) -> NDArray[np.float32]:
    """Observations of all sizes that entries have, from small to their bound of 5."""
    draw = np.random.default_rng(0)
    rows = (
        draw.normal(size=(OBSERVATIONS, entries)) * np.geomspace(0.01, BOUND, OBSERVATIONS)[:, None]
    )
    return np.clip(rows, -BOUND, BOUND).astype(np.float32)


def _in_float32(weights: Weights, rows: NDArray[np.float32]) -> NDArray[np.float32]:
    """What float32 makes of the network, shape (count, outputs)."""
    values = rows
    if weights.scaling:
        mean, variance, epsilon, clip = weights.scaling
        scaled = np.clip((rows - mean) / np.sqrt(variance + epsilon), -clip, clip)
        values = scaled.astype(np.float32)
    *hidden, last = weights.layers
    for weight, bias in hidden:
        values = values @ weight.T + bias
        values = np.tanh(values) if weights.activation == "tanh" else np.maximum(values, 0.0)
    values = values @ last.weight.T + last.bias
    return np.tanh(values) if weights.output == "tanh" else np.clip(values, -1.0, 1.0)
