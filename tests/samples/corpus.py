"""Walks of public archives, which are not part of the project."""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from kinemimic.pipeline.convert import convert, on_nodes
from kinemimic.pipeline.ingest import ingest
from kinemimic.pipeline.kinematics.clip import Clip


def corpus(folder: str) -> Path:
    """A folder of recordings beside the captures; the test is skipped without it."""
    captures = os.environ.get(
        "KINEMIMIC_CAPTURES", Path(__file__).resolve().parents[3] / "shared" / "captures"
    )
    found = Path(captures).parent / "corpus" / folder
    if not found.is_dir():
        pytest.skip(f"no recordings of {folder} here: set KINEMIMIC_CAPTURES to the folder beside theirs")
    return found


def published(captures: Path, name: str) -> Path:
    """A file of the catalogue, "COLLECTION/FILE": a capture, or a file of another sensor beside the captures.

    There, files are in the folders that they were published in ("__" in the catalogue).
    """
    found = captures / name
    return found if found.exists() else captures.parent / "sensors" / name.replace("__", "/")


@cache
def recorded(path: Path) -> Clip:
    """A recording on the 20 nodes, as `retarget` reads it."""
    with TemporaryDirectory() as folder:
        ingest(path, Path(folder))
        return on_nodes(convert(Path(folder)))


def cmu(name: str) -> Clip:
    """A clip of the CMU motion capture database."""
    return recorded(corpus("cmu_bvh") / f"{name}.bvh")
