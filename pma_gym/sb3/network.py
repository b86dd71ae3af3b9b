"""Linear layers with tanh between them, computed with less arithmetic on a processor.

PyTorch's tanh costs three times as much as the logistic function s. So a hidden layer's tanh is
computed from s, and the products of matrices take the linear part:

    h_k = tanh(W_k h_(k-1) + b_k) = 2 s_k - 1
    s_1 = s(2 (W_1 x + b_1))
    s_k = s(4 W_k s_(k-1) + 2 (b_k - W_k 1))        y = 2 W_n s_(n-1) + b_n - W_n 1

h itself is never computed. Its derivative 1 - h^2 is 4 s (1 - s).

Networks of the same observations whose layers have the same shapes, such as actor and critic, are
computed side by side: half the calls of PyTorch, and of two threads each has a network.
"""

from collections.abc import Callable, Sequence
from itertools import chain
from typing import Any

import torch
from torch import Tensor, nn
from torch.autograd.function import once_differentiable

Layers = Sequence[tuple[Tensor, Tensor]]
"""Weights and biases, or their derivatives: shapes (outputs, inputs) and (outputs,); of networks
side by side (networks, outputs, inputs) and (networks, outputs), as everything below has such an
axis in front then."""

Layer = tuple[Tensor, Tensor, float, float]
"""Transposed weights, shape (inputs, outputs), biases, shape (outputs,) or (networks, 1, outputs),
and factors on the product with the former and on the latter: powers of two, with which no bit
depends on when they are multiplied in."""


def is_plain(modules: Sequence[nn.Module]) -> bool:
    """Return whether modules alternate Linear and Tanh, end in Linear, and have a hidden layer."""
    linear, between = modules[::2], modules[1::2]
    return (
        len(linear) == len(between) + 1 > 1
        and all(type(one) is nn.Tanh for one in between)
        and all(type(one) is nn.Linear and one.bias is not None for one in linear)
    )


def layers_of(modules: Sequence[nn.Module]) -> Layers:
    """Return weights and biases of modules for which `is_plain` is true."""
    linear: Any = modules[::2]
    return [(one.weight, one.bias) for one in linear]


def alike(nets: Sequence[Layers]) -> Sequence[Sequence[Layers]]:
    """Group networks that can be stacked: one group if all shapes agree, else one each."""
    shapes = {tuple(weight.shape for weight, _ in layers) for layers in nets}
    return [nets] if len(shapes) == 1 else [[layers] for layers in nets]


def side_by_side(nets: Sequence[Layers]) -> Layers:
    """Stack networks of equal shapes into new tensors; return a single network unchanged."""
    if len(nets) == 1:
        return nets[0]
    return [
        (torch.stack([weight for weight, _ in of_one]), torch.stack([bias for _, bias in of_one]))
        for of_one in zip(*nets, strict=True)
    ]


def scaled(layers: Layers) -> Sequence[Layer]:
    """Rewrite layers for `passed`: with products of s in place of h.

    Args:
        layers: two or more.
    """
    (weight, bias), *between, (last, last_bias) = layers
    scaled_layers = [
        (weight.mT, bias, 2.0, 2.0),
        *((weight.mT, bias - weight.sum(-1), 4.0, 2.0) for weight, bias in between),
        (last.mT, last_bias - last.sum(-1), 2.0, 1.0),
    ]
    if weight.dim() == 2:
        return scaled_layers
    return [(weight, bias[:, None], alpha, beta) for weight, bias, alpha, beta in scaled_layers]


def passed(x: Tensor, layers: Sequence[Layer], out: Sequence[Tensor] = ()) -> list[Tensor]:
    """Compute the output s of every hidden layer, and y; shapes (rows, outputs).

    Args:
        x: the same for all networks, shape (rows, inputs).
        layers: scaled ones.
        out: where to write each s; empty for fresh memory.
    """
    *hidden, last = layers
    outputs = [_shared(x, last[0])]
    for layer, place in zip(hidden, out or [None] * len(hidden), strict=True):
        outputs.append(_linear(outputs[-1], layer, place).sigmoid_())
    return [*outputs[1:], _linear(outputs[-1], last)]


def _shared(x: Tensor, among: Tensor) -> Tensor:
    return x if among.dim() == 2 else x.expand(len(among), *x.shape)


def _linear(x: Tensor, layer: Layer, out: Tensor | None = None) -> Tensor:
    weight, bias, alpha, beta = layer
    return _added(x)(bias, x, weight, alpha=alpha, beta=beta, out=out)


def _added(factor: Tensor) -> Callable[..., Tensor]:
    """Return the function that adds a matrix product to a tensor."""
    return torch.addmm if factor.dim() == 2 else torch.baddbmm


def network(x: Tensor, layers: Layers) -> Tensor:
    """Evaluate a network, as one node of PyTorch's graph.

    Args:
        x: shape (rows, inputs).
        layers: two or more.
    Returns:
        Shape (rows, outputs).
    """
    if torch.is_grad_enabled():
        return _Network.apply(x, *chain.from_iterable(layers))
    return passed(x, scaled(layers))[-1]


def derivatives(
    grad_output: Tensor,
    x: Tensor,
    weights: Sequence[Tensor],
    hidden: Sequence[Tensor],
    out: "Derivatives",
) -> Tensor:
    """Backpropagate derivatives by y to weights and biases, and write these to `out`.

    Args:
        grad_output: shape (rows, outputs).
        x: the same for all networks, shape (rows, inputs).
        weights: of the layers.
        hidden: outputs s of the hidden layers.
        out: where to write.
    Returns:
        Derivatives by the first layer's output before its tanh; shape (rows, outputs).
    """
    back = zip(weights[:0:-1], hidden[::-1], out.layers[:0:-1], out.hidden[::-1], strict=True)
    for weight, s, (of_weight, of_bias), place in back:
        torch.sum(grad_output, -2, out=of_bias)
        # By h = 2 s - 1.
        _added(grad_output)(of_bias[..., None], grad_output.mT, s, beta=-1, alpha=2, out=of_weight)
        if grad_output.shape[-1] == 1:
            # The same, in 0.4 of the time.
            grad_output = torch.mul(grad_output, 4.0 * weight, out=place)
        else:
            grad_output = _added(grad_output)(
                place, grad_output, weight, alpha=4.0, beta=0.0, out=place
            )
        torch.ops.aten.sigmoid_backward.grad_input(grad_output, s, grad_input=grad_output)
    of_weight, of_bias = out.layers[0]
    torch.sum(grad_output, -2, out=of_bias)
    # So, and not the other way round: few columns on the left are four times as fast.
    of_weight.copy_(_shared(x, grad_output).mT.matmul(grad_output).mT)
    return grad_output


class Derivatives:
    """Memory that derivatives are written to.

    Args:
        layers: derivatives by weights and biases, of their shapes.
        hidden: derivatives by the outputs of hidden layers, shapes (rows, outputs).
    """

    def __init__(self, layers: Layers, hidden: Sequence[Tensor]) -> None:
        self.layers, self.hidden = layers, hidden


class _Network(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, x: Tensor, *parameters: Tensor) -> Tensor:  # noqa: ANN401
        weights = parameters[::2]
        *hidden, y = passed(x, scaled(list(zip(weights, parameters[1::2], strict=True))))
        ctx.save_for_backward(*weights, x, *hidden)
        return y

    @staticmethod
    @once_differentiable
    def backward(  # pyright: ignore[reportIncompatibleMethodOverride] - by its decorator
        ctx: Any,  # noqa: ANN401
        *grad_outputs: Tensor,
    ) -> tuple[Tensor | None, ...]:
        (grad_output,), saved = grad_outputs, ctx.saved_tensors
        weights, (x, *hidden) = saved[: len(saved) // 2], saved[len(saved) // 2 :]
        layers = [(torch.empty_like(one), one.new_empty(len(one))) for one in weights]
        out = Derivatives(layers, [torch.empty_like(one) for one in hidden])
        first = derivatives(grad_output, x, weights, hidden, out)
        of_x = first.mm(weights[0]) if ctx.needs_input_grad[0] else None
        return of_x, *chain.from_iterable(layers)
