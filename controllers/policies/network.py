"""A trained network in NumPy: a multi-layer perceptron, the same bits alone or among many.

    y_0 = clip((x - mean) / sqrt(variance + epsilon), -c, c)    only with scaling
    y_k = f(W_k y_(k-1) + b_k)                                  hidden layers, f: tanh or ReLU
    u   = g(W_n y_(n-1) + b_n)                                  g: clip to -1..1, or tanh

It computes in float64 from float32 weights, so that what it says is good to far less than what
rounding in float32 does to the frameworks that trained it.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

ACTIVATIONS = ("tanh", "relu")
"""What follows a hidden layer."""

OUTPUTS = ("clip", "tanh")
"""What keeps the last layer's values in -1..1: `clip` (PPO) or `tanh` (SAC, TQC, TD3)."""


class Layer(NamedTuple):
    """One layer.

    Attributes:
        weight: shape (outputs, inputs), float32.
        bias: shape (outputs,), float32.
    """

    weight: NDArray[np.float32]
    bias: NDArray[np.float32]


class Scaling(NamedTuple):
    """Scaling of the observation as Stable-Baselines3's VecNormalize has it.

    Attributes:
        mean: shape (inputs,), float64.
        variance: shape (inputs,), float64, not negative.
        epsilon: added to the variance.
        clip: scaled entries are held in -clip..clip.
    """

    mean: NDArray[np.float64]
    variance: NDArray[np.float64]
    epsilon: float
    clip: float


class Weights(NamedTuple):
    """Layers and scaling of a network; a `Network` computes its actions.

    Attributes:
        layers: from the observation to the action; each takes what the one before gives.
        activation: one of `ACTIVATIONS`.
        output: one of `OUTPUTS`.
        scaling: of the observation, or None.
    """

    layers: tuple[Layer, ...]
    activation: str
    output: str
    scaling: Scaling | None = None

    @property
    def sizes(self) -> list[int]:
        """Entries of the observation, values of every layer: as [48, 64, 64, 1]."""
        return [self.layers[0].weight.shape[1], *(len(layer.bias) for layer in self.layers)]


class Network:
    """Computes a network's actions; one for each thread, for it keeps its intermediate values.

    Args:
        weights: the network.
    Raises:
        ValueError: no layers, layers that do not chain, an unknown activation or output.

    Example:
        >>> one = Layer(np.array([[2.0, -1.0]], np.float32), np.array([0.5], np.float32))
        >>> Network(Weights((one,), "tanh", "clip"))(np.array([0.1, 0.3]))
        array([0.4])
    """

    def __init__(self, weights: Weights) -> None:
        """Copy the weights and lay out the buffers."""
        check_chain(weights)
        self.weights = weights
        sizes = weights.sizes
        self._input = np.zeros(sizes[0])
        *self._hidden, self._last = [
            (np.ascontiguousarray(weight, np.float64), bias.astype(np.float64), np.zeros(size))
            for (weight, bias), size in zip(weights.layers, sizes[1:], strict=True)
        ]
        self._relu = weights.activation == "relu"
        self._tanh_output = weights.output == "tanh"
        self._scaling = weights.scaling
        self._rounded = np.zeros(sizes[0], np.float32)
        if weights.scaling:
            self._deviation = np.sqrt(weights.scaling.variance + weights.scaling.epsilon)

    def __call__(self, observation: NDArray[np.floating]) -> NDArray[np.float64]:
        """The action for one observation.

        Args:
            observation: shape (inputs,).
        Returns:
            The action, -1 to 1, shape (outputs,); an array of its own.
        Raises:
            ValueError: an observation of another shape.
        """
        if observation.shape != self._input.shape:
            raise ValueError(
                f"the network takes an observation of shape {self._input.shape}, got "
                f"{observation.shape}; give rows of several to `many`"
            )
        return self._computed(observation).copy()

    def many(self, observations: NDArray[np.floating]) -> NDArray[np.float64]:
        """The actions for several observations: for each row the same bits as for it alone.

        Args:
            observations: shape (count, inputs).
        Returns:
            The actions, shape (count, outputs).
        """
        # Row by row: one product of matrices sums in another order.
        rows = [self(row) for row in observations]
        return np.array(rows).reshape(len(rows), self.weights.sizes[-1])

    def _computed(self, observation: NDArray[np.floating]) -> NDArray[np.float64]:
        """The action in the last buffer."""
        values = self._scaled(observation)
        for weight, bias, out in self._hidden:
            np.add(np.dot(weight, values, out=out), bias, out=out)
            values = np.maximum(out, 0.0, out=out) if self._relu else np.tanh(out, out=out)
        weight, bias, out = self._last
        np.add(np.dot(weight, values, out=out), bias, out=out)
        if self._tanh_output:
            return np.tanh(out, out=out)
        return np.minimum(np.maximum(out, -1.0, out=out), 1.0, out=out)

    def _scaled(self, observation: NDArray[np.floating]) -> NDArray[np.float64]:
        """The observation in the first buffer."""
        values = self._input
        # Always from the same memory, so that its alignment cannot choose another order of sums.
        values[:] = observation
        if self._scaling is None:
            return values
        mean, _, _, limit = self._scaling
        np.subtract(values, mean, out=values)
        np.divide(values, self._deviation, out=values)
        np.minimum(np.maximum(values, -limit, out=values), limit, out=values)
        # The network was trained with scaled observations in float32.
        self._rounded[:] = values
        values[:] = self._rounded
        return values


def check_chain(weights: Weights) -> None:
    """Refuse layers that do not chain, and what follows them if nobody knows it.

    Raises:
        ValueError: says which layer, what it takes and what the one before gives.
    """
    if not weights.layers:
        raise ValueError("a network must have at least one layer, got none")
    for what, name, known in (
        ("activation", weights.activation, ACTIVATIONS),
        ("output", weights.output, OUTPUTS),
    ):
        if name not in known:
            raise ValueError(f"{what} must be one of {', '.join(known)}, got {name!r}")
    before: int | None = None
    for i, (weight, bias) in enumerate(weights.layers):
        if weight.ndim != 2 or bias.shape != weight.shape[:1]:
            raise ValueError(
                f"layer {i} must have a weight of shape (outputs, inputs) and a bias of shape "
                f"(outputs,), got {weight.shape} and {bias.shape}"
            )
        if before not in (None, weight.shape[1]):
            raise ValueError(
                f"layer {i} takes {weight.shape[1]} values, layer {i - 1} gives {before}; "
                "they must be as many"
            )
        before = weight.shape[0]
    _check_scaling(weights.scaling, weights.layers)


def _check_scaling(scaling: Scaling | None, layers: Sequence[Layer]) -> None:
    inputs = layers[0].weight.shape[1:]
    if scaling is None:
        return
    for what, values in (("mean", scaling.mean), ("variance", scaling.variance)):
        if values.shape != inputs:
            raise ValueError(
                f"the scaling's {what} must have a value for each of the {inputs[0]} entries of "
                f"the observation, got shape {values.shape}"
            )
    if not (np.all(scaling.variance >= 0.0) and scaling.epsilon > 0.0 and scaling.clip > 0.0):
        raise ValueError(
            "the scaling's variance must not be negative, its epsilon and clip must be positive; "
            f"got a least variance of {scaling.variance.min():g}, epsilon {scaling.epsilon:g}, "
            f"clip {scaling.clip:g}"
        )
