"""How the shipped policies are trained (datasets/policies/recipes.toml), and where their recordings are."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from msgspec import Struct

from kinemimic.pipeline.catalog.entry import Entry
from kinemimic.pipeline.catalog.load import load_catalog
from kinemimic.pipeline.files.data_folder import DATASETS
from kinemimic.pipeline.files.validation.bounded import MEGABYTE
from kinemimic.pipeline.files.validation.records import convert
from kinemimic.pipeline.files.validation.toml_file import parse_toml, read_text

POLICIES = DATASETS / "policies"


class Recipe(Struct, frozen=True, forbid_unknown_fields=True):
    """Motion and settings of a training run.

    stock: name of a motion in the pybullet wheel; recording: name of a recording in catalog.toml; with
    neither, the virtual Kinect's walk. start: tracker to start from; with none, random weights. teachers:
    folder in datasets/ of the policies to join it with. budget: samples.
    """

    name: str
    description: str
    preset: str
    budget: int
    seed: int
    start: str | None = None
    teachers: str | None = None
    stock: str | None = None
    recording: str | None = None

    @property
    def teachers_folder(self) -> Path | None:
        """Where the teachers are: only in the repository, to which the links of an editable install lead."""
        datasets = (DATASETS / "catalog.toml").resolve().parent
        return None if self.teachers is None else datasets / self.teachers


class TrackerRecipe(Struct, frozen=True, forbid_unknown_fields=True):
    """Library and settings of a tracker's training.

    test: subjects that are left out; preset: of `train-tracker`; variants, exercises: how many; budget:
    samples.
    """

    name: str
    description: str
    test: tuple[str, ...]
    budget: int
    seed: int
    preset: str = "tracker"
    variants: int = 0
    exercises: int = 0


class _File(Struct, forbid_unknown_fields=True):
    schema: Literal[2]
    policy: tuple[Recipe, ...]
    tracker: tuple[TrackerRecipe, ...] = ()


def _read(folder: Path) -> _File:
    path = folder / "recipes.toml"
    return convert(parse_toml(path, read_text(path, MEGABYTE, "recipes")), _File, path)


def recipes(folder: Path = POLICIES) -> dict[str, Recipe]:
    """Every recipe of a policy for one motion by name, in the order of the file."""
    return {recipe.name: recipe for recipe in _read(folder).policy}


def tracker_recipes(folder: Path = POLICIES) -> dict[str, TrackerRecipe]:
    """Every recipe of a tracker by name, in the order of the file."""
    return {recipe.name: recipe for recipe in _read(folder).tracker}


def recording(name: str) -> Entry:
    """A recording of the catalogue."""
    return load_catalog().entry(name)
