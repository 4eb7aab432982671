"""What every test may use."""

from __future__ import annotations

import os
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from peers.ray_nodes import RayNodes
from peers.wheels import build_wheel

# No test depends on how fast or how busy the machine is.
settings.register_profile("untimed", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("untimed")


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


@pytest.fixture(scope="session")
def running_ray() -> Iterator[RayNodes]:
    """A Ray cluster for all tests that need one: its start takes 5 s."""
    if find_spec("ray") is None:
        pytest.skip("the extra `scale` is not installed")
    nodes = RayNodes.started()
    yield nodes
    nodes.end()


@pytest.fixture
def ray_nodes(running_ray: RayNodes) -> RayNodes:
    """A head and two nodes of Ray, those that an earlier test killed started anew."""
    running_ray.repaired()
    return running_ray
