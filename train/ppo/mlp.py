"""A tanh network with an explicit gradient: no autograd graph, and all weights in one vector."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import torch
from torch import Tensor, nn

CPU = torch.device("cpu")


def choose_gradient_dtype(device: torch.device = CPU) -> torch.dtype:
    """Choose torch's fastest exact float32 matrix product; returns the dtype for products of gradients.

    A GPU multiplies in float32 throughout: TensorFloat-32 would round outputs, and training hardly ever waits
    for the update there.

    On a CPU, torch gives float32 products to MKL, which runs AVX2 code on processors that are not Intel's.
    The setting "medium" gives them to oneDNN, which uses AVX-512 everywhere and is twice as fast, but may
    round to bfloat16. It does so only with matrix tiles (AMX); a test product detects that, and MKL stays in
    use. Gradients tolerate bfloat16: it changes them by 0.1 to 0.5 % of their length, another minibatch by 30
    to 160 %. Outputs stay exact, because ratios and KL compare with a policy that acts in float32.
    """
    if device != CPU:
        torch.set_float32_matmul_precision("highest")
        return torch.float32
    test = torch.linspace(1.0, 2.0, 256 * 256).view(256, 256)
    exact = test.double() @ test.double()
    torch.set_float32_matmul_precision("medium")
    if not torch.allclose((test @ test).double(), exact, rtol=1e-5):
        torch.set_float32_matmul_precision("highest")
    # Public only in the latest torch; a torch without this name multiplies in float32.
    native = getattr(torch.cpu, "_is_avx512_bf16_supported", None)
    return torch.bfloat16 if native and native() else torch.float32


def _layers(flat: Tensor, sizes: tuple[int, ...]) -> list[tuple[Tensor, Tensor]]:
    """Views of a flat vector: weight (out, in) and bias (out,) of every layer."""
    layers, at = [], 0
    for a, b in pairwise(sizes):
        layers.append((flat[at : at + a * b].view(b, a), flat[at + a * b : at + a * b + b]))
        at += a * b + b
    return layers


class _Buffers:
    """Memory for a forward and backward pass over `rows` rows, kept for the next one.

    Allocating it for every pass can cost 10 to 40 % of the time.

    hidden: (N, size) outputs of the hidden layers. inputs, gradients: (N, in), (N, out) of every layer, in
    the dtype of `backward`: its input, and the gradient of the loss with respect to its output.
    """

    def __init__(
        self, rows: int, sizes: tuple[int, ...], gradient_dtype: torch.dtype, device: torch.device
    ) -> None:
        self.rows = rows
        self.hidden = [torch.empty(rows, size, device=device) for size in sizes[1:-1]]
        self.inputs = [torch.empty(rows, size, dtype=gradient_dtype, device=device) for size in sizes[:-1]]
        self.gradients = [torch.empty(rows, size, dtype=gradient_dtype, device=device) for size in sizes[1:]]


class Mlp:
    """Linear layers with tanh between, orthogonal weights; `last_gain` scales the output layer.

    sizes: of the input, the hidden layers, the output. gradient_dtype: of the products in `backward`.
    device: of all tensors; the first weights are the same on every device.
    parameters, gradient: (P,) all layers in one vector, so that optimiser and norm take one call each;
    gradient is parameters' `.grad`. layers: (weight (out, in), bias (out,)) views of the parameters.
    """

    def __init__(
        self,
        sizes: tuple[int, ...],
        last_gain: float,
        gradient_dtype: torch.dtype = torch.float32,
        device: torch.device = CPU,
    ) -> None:
        self._sizes = sizes
        self._gradient_dtype = gradient_dtype
        self._device = device
        count = sum((a + 1) * b for a, b in pairwise(sizes))
        first = torch.zeros(count)
        layers = _layers(first, sizes)
        for weight, _ in layers[:-1]:
            nn.init.orthogonal_(weight, 5 / 3)
        nn.init.orthogonal_(layers[-1][0], last_gain)
        self.parameters = first.to(device)
        self.gradient = torch.zeros(count, device=device)
        self.parameters.grad = self.gradient
        self.layers = _layers(self.parameters, sizes)
        self._rounded_parameters, self._rounded_gradient = torch.zeros(
            2, count, dtype=gradient_dtype, device=device
        )
        self._input = torch.empty(0, sizes[0], device=device)
        self._buffers = _Buffers(0, sizes, gradient_dtype, device)

    def split(self, flat: Tensor) -> list[tuple[Tensor, Tensor]]:
        """Views of a vector (P,) like `parameters`, as `layers`."""
        return _layers(flat, self._sizes)

    def forward(self, x: Tensor) -> Tensor:
        """Output (N, out) for input (N, in), which must not change until `backward`."""
        if self._buffers.rows != len(x):
            self._buffers = _Buffers(len(x), self._sizes, self._gradient_dtype, self._device)
        self._input = x
        for (weight, bias), hidden in zip(self.layers[:-1], self._buffers.hidden, strict=True):
            torch.addmm(bias, x, weight.t(), out=hidden)
            if self._device == CPU:
                # numpy's tanh: torch's takes thirteen times as long, as much as the product before it.
                np.tanh(hidden.numpy(), out=hidden.numpy())
            else:
                hidden.tanh_()
            x = hidden
        weight, bias = self.layers[-1]
        return torch.addmm(bias, x, weight.t())

    def backward(self, output_gradient: Tensor) -> None:
        """Fill `gradient`, given the loss's gradient (N, out) with respect to the last output."""
        buffers = self._buffers
        weights = _layers(self._rounded_parameters.copy_(self.parameters), self._sizes)
        gradients = _layers(self._rounded_gradient, self._sizes)
        outward = buffers.gradients[-1].copy_(output_gradient)
        for k in reversed(range(len(weights))):
            inputs = buffers.inputs[k].copy_(buffers.hidden[k - 1] if k > 0 else self._input)
            by_weight, by_bias = gradients[k]
            torch.mm(outward.t(), inputs, out=by_weight)
            torch.sum(outward, 0, out=by_bias)
            if k > 0:
                outward = torch.mm(outward, weights[k][0], out=buffers.gradients[k - 1])
                torch.ops.aten.tanh_backward.grad_input(outward, inputs, grad_input=outward)
        self.gradient.copy_(self._rounded_gradient)
