"""Provenance records of outputs: equal input, configuration, versions and seed give an equal record."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any

# Packages whose version can change a result.
_PACKAGES = ("kinemimic", "numpy", "scipy", "pybullet", "torch")


def versions() -> dict[str, str]:
    """Installed versions of these packages, without importing them; a missing one is left out."""
    return dict(_versions(tuple(sys.path)))


@lru_cache(maxsize=1)
def _versions(_path: tuple[str, ...]) -> dict[str, str]:
    """What is installed on the import path, looked up once: that takes 10 ms, as much as a short stage."""
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
    """The record that every output carries: JSON values with sorted keys and no time stamps.

    Equal runs write equal bytes. stage: the command that wrote it; inputs: name -> SHA-256 of a file that it
    read; config: its options.
    """
    return {
        "stage": stage,
        "inputs": dict(sorted(inputs.items())),
        "config": dict(sorted(config.items())),
        "seed": seed,
        "versions": versions(),
    }
