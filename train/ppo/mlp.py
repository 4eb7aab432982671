"""A tanh network whose gradient is written out: no graph is recorded, and all weights are one vector."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import torch
from torch import Tensor, nn


def choose_products() -> torch.dtype:
    """Let torch multiply matrices as fast as loses nothing; returns the type for products of gradients.

    torch gives float32 products to MKL, which runs AVX2 code on processors that are not Intel's. The setting
    "medium" gives them to oneDNN, which knows AVX-512 everywhere, twice as fast, and may round to bfloat16:
    it does so only with matrix tiles (AMX), and there a trial product shows it and MKL stays.
    Gradients bear bfloat16: it moves them by 0.1 to 0.5 % of their length, another minibatch by 30 to 160 %.
    Outputs stay exact, for ratios and KL compare with a policy that acts in float32.
    """
    trial = torch.linspace(1.0, 2.0, 256 * 256).view(256, 256)
    exact = trial.double() @ trial.double()
    torch.set_float32_matmul_precision("medium")
    if not torch.allclose((trial @ trial).double(), exact, rtol=1e-5):
        torch.set_float32_matmul_precision("highest")
    # No public name before torch's latest; a torch without this one multiplies in float32.
    native = getattr(torch.cpu, "_is_avx512_bf16_supported", None)
    return torch.bfloat16 if native and native() else torch.float32


def _layers(flat: Tensor, sizes: tuple[int, ...]) -> list[tuple[Tensor, Tensor]]:
    """Views of a flat vector: weight (out, in) and bias (out,) of every layer."""
    found, at = [], 0
    for a, b in pairwise(sizes):
        found.append((flat[at : at + a * b].view(b, a), flat[at + a * b : at + a * b + b]))
        at += a * b + b
    return found


class _Space:
    """What a pass over `rows` rows writes, kept for the next one.

    Where malloc gets the memory from the system anew for every pass, that costs 10 to 40 % of its time.

    hidden: (N, size) what leaves each hidden layer. entered, slopes: (N, in), (N, out) of every layer, in the
    type of `backward`: its input, and the slope of the loss with respect to its output.
    """

    def __init__(self, rows: int, sizes: tuple[int, ...], products: torch.dtype) -> None:
        self.rows = rows
        self.hidden = [torch.empty(rows, size) for size in sizes[1:-1]]
        self.entered = [torch.empty(rows, size, dtype=products) for size in sizes[:-1]]
        self.slopes = [torch.empty(rows, size, dtype=products) for size in sizes[1:]]


class Mlp:
    """Linear layers with tanh between, orthogonal weights; `last_gain` scales the output layer.

    sizes: of the input, of every hidden layer, of the output. products: type in which `backward` multiplies.
    parameters, gradient: (P,) all layers in a row, so that an optimiser and a norm are one call each; the
    second is the first one's `.grad`. layers: (weight (out, in), bias (out,)) views of the parameters.
    """

    def __init__(
        self, sizes: tuple[int, ...], last_gain: float, products: torch.dtype = torch.float32
    ) -> None:
        self._sizes = sizes
        self._products = products
        count = sum((a + 1) * b for a, b in pairwise(sizes))
        self.parameters = torch.zeros(count)
        self.gradient = torch.zeros(count)
        self.parameters.grad = self.gradient
        self.layers = _layers(self.parameters, sizes)
        self._rounded_parameters, self._rounded_gradient = torch.zeros(2, count, dtype=products)
        self._input = torch.empty(0, sizes[0])
        self._space = _Space(0, sizes, products)
        for weight, _ in self.layers[:-1]:
            nn.init.orthogonal_(weight, 5 / 3)
        nn.init.orthogonal_(self.layers[-1][0], last_gain)

    def forward(self, x: Tensor) -> Tensor:
        """Output (N, out) for input (N, in), which stays as it is until `backward`."""
        if self._space.rows != len(x):
            self._space = _Space(len(x), self._sizes, self._products)
        self._input = x
        for (weight, bias), hidden in zip(self.layers[:-1], self._space.hidden, strict=True):
            torch.addmm(bias, x, weight.t(), out=hidden)
            # numpy's tanh: torch's takes thirteen times as long, about as long as the product before it.
            np.tanh(hidden.numpy(), out=hidden.numpy())
            x = hidden
        weight, bias = self.layers[-1]
        return torch.addmm(bias, x, weight.t())

    def backward(self, slope: Tensor) -> None:
        """Fill `gradient`, given the slope (N, out) of the loss with respect to the last output."""
        space = self._space
        weights = _layers(self._rounded_parameters.copy_(self.parameters), self._sizes)
        by_layer = _layers(self._rounded_gradient, self._sizes)
        below = space.slopes[-1].copy_(slope)
        for k in reversed(range(len(weights))):
            entered = space.entered[k].copy_(space.hidden[k - 1] if k > 0 else self._input)
            by_weight, by_bias = by_layer[k]
            torch.mm(below.t(), entered, out=by_weight)
            torch.sum(below, 0, out=by_bias)
            if k > 0:
                below = torch.mm(below, weights[k][0], out=space.slopes[k - 1])
                torch.ops.aten.tanh_backward.grad_input(below, entered, grad_input=below)
        self.gradient.copy_(self._rounded_gradient)
