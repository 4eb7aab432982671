"""What every test may use."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from peers.wheels import build_wheel


@pytest.fixture(scope="session")
def captures() -> Path:
    """The folder of real recordings, which is not part of the project."""
    beside = Path(__file__).resolve().parents[2] / "shared" / "captures"
    folder = Path(os.environ.get("KINEMIMIC_CAPTURES", beside))
    if not folder.is_dir():
        pytest.skip("no real recordings here: set KINEMIMIC_CAPTURES to the folder that holds them")
    return folder


@pytest.fixture(scope="session")
def sensors(captures: Path) -> Path:
    """The folder of files of other sensors, beside the recordings; not part of the project either."""
    folder = captures.parent / "sensors"
    if not folder.is_dir():
        pytest.skip("no files of other sensors here: their folder is beside KINEMIMIC_CAPTURES")
    return folder


@pytest.fixture(scope="session")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built wheel."""
    return build_wheel(tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("dist"))
