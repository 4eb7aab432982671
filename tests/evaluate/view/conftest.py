from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from peers.viewed import FRAMES, fill, write_scores

from kinemimic.evaluate.view.command import view
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.rollout.trajectory import Trajectory


@pytest.fixture(scope="module")
def run(
    tmp_path_factory: pytest.TempPathFactory, walk: Motion, performance: Callable[..., Trajectory]
) -> Path:
    """A run folder, its view written."""
    folder = fill(tmp_path_factory.mktemp("view") / "run", walk, performance(2, FRAMES, offset=0.1))
    write_scores(folder)
    view(folder)
    return folder
