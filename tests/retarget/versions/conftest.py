"""A data set of one recording in a temporary folder."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from kinemimic.retarget.versions.build import STAGES, build_capture, built_path
from kinemimic.retarget.versions.manifest import lock
from kinemimic.retarget.versions.params import PARAMS, Params

ROOT = Path(__file__).resolve().parents[3]
NAME = "kinect_walk"
TEXT = f"""schema = 1
version = 1
policies = []

[captures.{NAME}]
file = "datasets/versions/raw/{NAME}.skl"

[tolerances]
"""


@pytest.fixture(scope="session")
def once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The locked data set; tests must not change it."""
    root = tmp_path_factory.mktemp("data set")
    raw = Path("datasets/versions/raw")
    (root / raw).mkdir(parents=True)
    for path in (ROOT / raw).glob(f"{NAME}.*"):
        shutil.copy(path, root / raw)
    (root / PARAMS).write_text(TEXT)
    (root / "CHANGELOG.md").write_text("- Data 1: a walk.\n")
    params = Params.load(PARAMS, root)
    for file, made in build_capture(params.capture(NAME), root).items():
        made.write(built_path(params, root, NAME, file))
    assert {path.name for path in (root / "datasets/versions/built" / NAME).iterdir()} == set(STAGES.values())
    lock(params, root)
    return root


@pytest.fixture
def root(once: Path, tmp_path: Path) -> Path:
    """A copy of it."""
    return Path(shutil.copytree(once, tmp_path / "root"))


@pytest.fixture
def params(root: Path) -> Params:
    """Parameters of the copy, relative to its folder."""
    return Params.load(PARAMS, root)
