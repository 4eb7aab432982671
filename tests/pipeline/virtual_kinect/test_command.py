"""`datasets record` reproduces the committed recordings."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from kinemimic.pipeline.files.sidecars import note_path, read_note, read_truth, truth_path
from kinemimic.pipeline.virtual_kinect.command import command

RAW = Path(__file__).parents[3] / "datasets" / "versions" / "raw"
CAPTURES = ("kinect_walk.skl", "kinect_walk_euler.bvh", "kinect_run_euler.bvh")
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recorded")
    command.main(["walk", "run", "--into", str(folder)], standalone_mode=False)
    return folder


@pytest.mark.parametrize("name", CAPTURES)
def test_committed_recordings_are_reproduced(recorded: Path, name: str) -> None:
    before, now = (path.read_text(encoding="utf-8") for path in (RAW / name, recorded / name))
    assert _NUMBER.sub("#", before) == _NUMBER.sub("#", now)
    one, other = (np.array(_NUMBER.findall(text), dtype=np.float64) for text in (before, now))
    # Other processors may round the last digit differently.
    np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-4)


@pytest.mark.parametrize("name", CAPTURES)
def test_committed_truth_and_notes_are_reproduced(recorded: Path, name: str) -> None:
    one, other = (read_truth(truth_path(folder / name)) for folder in (RAW, recorded))
    assert one is not None and other is not None
    for column, curve in one.items():
        np.testing.assert_allclose(curve, other[column], rtol=0.0, atol=1e-9)
    notes = [read_note(note_path(folder / name)) for folder in (RAW, recorded)]
    for note in notes:
        # Of the packages that are installed, which may be others.
        del note["virtual_kinect"]["versions"]
    assert notes[0] == notes[1]
