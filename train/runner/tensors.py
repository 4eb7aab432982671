"""Names of the arrays in a checkpoint, and the state of an optimizer among them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

import torch
from torch import Tensor

MEMORY = "memory."  # a baseline's replay buffer, among the algorithm's arrays
_T = TypeVar("_T")


def below(prefix: str, arrays: Mapping[str, _T]) -> dict[str, _T]:
    """The arrays whose names begin with the prefix, without it."""
    return {name.removeprefix(prefix): array for name, array in arrays.items() if name.startswith(prefix)}


def restore_optimizer(optimizer: torch.optim.Optimizer, tensors: Mapping[str, Tensor]) -> None:
    """Load the state of an optimizer: tensors by "number of the weight.name", counted over its groups.

    ValueError for a tensor of another shape than its weight: torch does not check it, and would fail in the
    next round.
    """
    weights = [weight for group in optimizer.param_groups for weight in group["params"]]
    slots: dict[int, dict[str, Tensor]] = {}
    for name, value in tensors.items():
        index, slot = name.split(".")
        if value.ndim and value.shape != weights[int(index)].shape:
            raise ValueError(f"{name} of shape {tuple(value.shape)}")
        slots.setdefault(int(index), {})[slot] = value
    optimizer.load_state_dict({**optimizer.state_dict(), "state": slots})
