"""How the policies that ship are made (datasets/policies/recipes.toml), and where their recordings are."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kinemimic.pipeline.catalog.entry import Entry
from kinemimic.pipeline.catalog.load import load_catalog
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.data_folder import DATASETS

POLICIES = DATASETS / "policies"


@dataclass(frozen=True)
class Recipe:
    """What a policy is trained on, and how.

    stock: a motion of the pybullet wheel by name; recording: one of catalog.toml by name; with neither, the
    virtual Kinect's walk. budget: samples.
    """

    name: str
    told: str
    preset: str
    budget: int
    seed: int
    stock: str | None = None
    recording: str | None = None


def recipes(folder: Path = POLICIES) -> dict[str, Recipe]:
    """Every recipe by name, in the sequence of the file."""
    path = folder / "recipes.toml"
    try:
        made = [Recipe(**entry) for entry in _toml(path)["policy"]]
    except (KeyError, TypeError) as error:
        raise KinemimicError(f"{path}: expected recipes, found what does not fit: {error}") from None
    return {recipe.name: recipe for recipe in made}


def recording(name: str) -> Entry:
    """A recording of the catalogue."""
    return load_catalog().entry(name)


def _toml(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise KinemimicError(f"{path}: expected a file, found none; install kinemimic anew") from None
    except tomllib.TOMLDecodeError as error:
        raise KinemimicError(f"{path}: expected TOML, found {error}") from None
