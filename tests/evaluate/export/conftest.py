from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner
from peers.exported import FRAMES, captured
from samples.converted import write_converted

from kinemimic.evaluate.export.command import command
from kinemimic.retarget.formats.motion_json import motion_to_json, read_motion_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.rollout.trajectory import Trajectory


@pytest.fixture(scope="module")
def run(
    tmp_path_factory: pytest.TempPathFactory, walk: Motion, performance: Callable[..., Trajectory]
) -> Path:
    folder = tmp_path_factory.mktemp("export") / "walk"
    folder.mkdir()
    write_converted(folder, captured())
    (folder / "motion.json").write_text(motion_to_json(walk))
    identity = read_motion_json(folder / "motion.json").identity
    replace(performance(2, FRAMES, offset=0.1), motion=identity).save(folder / "trajectory.npz")
    return folder


@pytest.fixture(scope="module")
def files(run: Path) -> list[dict[str, object]]:
    """The --json output of an export of everything."""
    result = CliRunner().invoke(command, ["--run", str(run), "--json"], catch_exceptions=False)
    assert result.exit_code == 0
    return json.loads(result.stdout)  # type: ignore[no-any-return]
