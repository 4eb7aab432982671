from __future__ import annotations

from pathlib import Path

import pytest

from kinemimic.evaluate.policies.shipped import ShippedPolicies


@pytest.fixture(scope="module")
def walk_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run folder with the walk that ships."""
    folder = tmp_path_factory.mktemp("walk") / "run"
    ShippedPolicies().prepare("walk", folder)
    return folder
