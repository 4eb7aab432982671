"""The gradient that is written out against the one that torch derives."""

from __future__ import annotations

import pytest
import torch
from peers.plain_ppo import sequential

from kinemimic.train.ppo.mlp import Mlp, choose_gradient_dtype

SIZES = (30, 20, 10, 4)


@pytest.fixture
def mlp(request: pytest.FixtureRequest) -> Mlp:
    torch.manual_seed(0)
    mlp = Mlp(SIZES, 1.0, getattr(request, "param", torch.float32))
    mlp.parameters += 0.1 * torch.randn(len(mlp.parameters))  # biases other than zero
    return mlp


@pytest.mark.parametrize(
    ("mlp", "tolerance"), [(torch.float32, 1e-6), (torch.bfloat16, 1e-2)], indirect=["mlp"]
)
def test_output_and_gradient_are_those_of_torch(mlp: Mlp, tolerance: float) -> None:
    """bfloat16 has eight bits: its gradient is off by a few thousandths, its output by nothing."""
    net = sequential(mlp).double()
    for rows in (64, 7):  # a last minibatch may be smaller than the others
        x, slope = torch.randn(rows, SIZES[0]), torch.randn(rows, SIZES[-1])
        wanted = net(x.double())
        torch.testing.assert_close(mlp.forward(x).double(), wanted.detach(), rtol=1e-5, atol=1e-5)
        mlp.backward(slope)
        net.zero_grad()
        wanted.backward(slope.double())
        gradient = torch.cat([p.grad.reshape(-1) for p in net.parameters()])
        assert (mlp.gradient - gradient).norm() <= tolerance * gradient.norm()


def test_outputs_outlive_the_next_call(mlp: Mlp) -> None:
    """The old policy's means are kept over an update whose minibatch is the whole batch."""
    x = torch.randn(5, SIZES[0])
    first = mlp.forward(x)
    before = first.clone()
    mlp.forward(-x)
    assert torch.equal(first, before)


def test_layers_are_views_and_the_gradient_is_the_optimisers(mlp: Mlp) -> None:
    assert mlp.parameters.numel() == sum(w.numel() + b.numel() for w, b in mlp.layers)
    before = mlp.layers[0][0].clone()
    mlp.gradient.fill_(1.0)
    torch.optim.SGD([mlp.parameters], 0.5).step()
    torch.testing.assert_close(mlp.layers[0][0], before - 0.5)


def test_hidden_layers_start_orthogonal() -> None:
    weight = Mlp(SIZES, 1.0).layers[0][0]
    torch.testing.assert_close(weight @ weight.t(), (5 / 3) ** 2 * torch.eye(20), atol=1e-5, rtol=0)


def test_gradients_are_float32_where_nothing_tells_of_bfloat16(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(torch.cpu, "_is_avx512_bf16_supported", raising=False)
    assert choose_gradient_dtype() == torch.float32


def test_float32_products_stay_exact() -> None:
    """What the trial in `choose_gradient_dtype` promises, on other numbers."""
    choose_gradient_dtype()
    a, b = torch.randn(2, 300, 300)
    exact = a.double() @ b.double()
    assert ((a @ b).double() - exact).norm() < 1e-6 * exact.norm()
