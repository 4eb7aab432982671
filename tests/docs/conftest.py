"""A finished run, for the pages that start with one."""

from __future__ import annotations

from pathlib import Path

import pytest
from printed.reading import environment, shell


@pytest.fixture(scope="session")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with runs/walk after every stage: the virtual Kinect's walk, after a very short training."""
    folder = tmp_path_factory.mktemp("workshop")
    done = shell("kinemimic run --run runs/walk --budget 4096", folder, environment())
    assert done.returncode == 0, done.stderr
    return folder
