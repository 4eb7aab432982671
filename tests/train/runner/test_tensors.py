"""The state of an optimizer, out of a checkpoint and back."""

from __future__ import annotations

import pytest
import torch

from kinemimic.train.runner.tensors import below, restore_optimizer


def stepped() -> torch.optim.Optimizer:
    weights = [torch.nn.Parameter(torch.ones(3, 2)), torch.nn.Parameter(torch.ones(3))]
    groups = [{"params": weights[:1], "lr": 0.1}, {"params": weights[1:], "lr": 0.2}]
    optimizer = torch.optim.Adam(groups)
    for weight in weights:
        weight.grad = torch.full_like(weight, 0.5)
    optimizer.step()
    return optimizer


def flat(optimizer: torch.optim.Optimizer) -> dict[str, torch.Tensor]:
    state = optimizer.state_dict()["state"]
    return {f"{index}.{slot}": value for index, slots in state.items() for slot, value in slots.items()}


def test_the_state_comes_back() -> None:
    saved, fresh = flat(stepped()), stepped()
    fresh.state.clear()
    restore_optimizer(fresh, below("critic.", {f"critic.{name}": value for name, value in saved.items()}))
    assert flat(fresh).keys() == saved.keys()
    assert all(torch.equal(flat(fresh)[name], value) for name, value in saved.items())


def test_a_slot_of_another_shape_is_refused() -> None:
    saved = flat(stepped())
    saved["0.exp_avg"] = torch.zeros(2, 3)
    with pytest.raises(ValueError, match=r"0\.exp_avg of shape \(2, 3\)"):
        restore_optimizer(stepped(), saved)
