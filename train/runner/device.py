"""The device that updates the networks: the CPU, or a GPU that PyTorch can use."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

from kinemimic.pipeline.errors import KinemimicError

if TYPE_CHECKING:
    import torch

DEVICES = ("cpu", "cuda")
_Command = TypeVar("_Command", bound=Callable[..., Any])


def device_named(name: str) -> torch.device:
    """The device of that name; KinemimicError for an unknown one, or without a GPU that PyTorch can use."""
    import torch  # noqa: PLC0415 (takes a second, and commands import this module for the option)

    if name not in DEVICES:
        raise KinemimicError(f"expected a device among {', '.join(DEVICES)}, found {name!r}")
    if name == "cuda" and not torch.cuda.is_available():
        raise KinemimicError(
            f"--device cuda: expected a GPU that PyTorch can use, found none with torch {torch.__version__}; "
            "install a build of torch for CUDA, or update on the CPU (--device cpu)"
        )
    return torch.device(name)


def device_option(purpose: str) -> Callable[[_Command], _Command]:
    """The option --device; purpose: its help."""
    return click.option(
        "--device",
        type=click.Choice(DEVICES),
        default=DEVICES[0],
        show_default=True,
        help=purpose,
    )
