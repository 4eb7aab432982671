"""Where an output comes from: the same input, configuration, versions and seed give the same record."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from typing import Any

# The packages whose release can change a number; a clip or a motion made by another one may differ.
_PACKAGES = ("kinemimic", "numpy", "scipy", "pybullet", "torch")


def versions() -> dict[str, str]:
    """Installed versions of what computes results, nothing of it imported; an absent one is left out."""
    found: dict[str, str] = {}
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found


def provenance(
    stage: str, *, inputs: Mapping[str, str], config: Mapping[str, Any], seed: int | None = None
) -> dict[str, Any]:
    """The record that every output carries: JSON values, keys sorted, no time stamps.

    Two equal runs write equal bytes. stage: the command that wrote it; inputs: name -> SHA-256 of what it
    read; config: the options it ran with.
    """
    return {
        "stage": stage,
        "inputs": dict(sorted(inputs.items())),
        "config": dict(sorted(config.items())),
        "seed": seed,
        "versions": versions(),
    }
