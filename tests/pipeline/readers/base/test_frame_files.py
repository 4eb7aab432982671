"""A folder of JSON files of a frame each is one capture; other folders are not."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples.joint_array import joints
from samples.joint_json import files
from samples.motion import walk

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.base import frame_files
from kinemimic.pipeline.readers.base.frame_files import is_folder_of_frames
from kinemimic.pipeline.readers.landmarks.joint_sets import SETS
from kinemimic.pipeline.readers.search import find_files

FRAMES = 30
BODY_25 = next(one for one in SETS if one.name == "OpenPose BODY_25")
SHOWN = walk(FRAMES)


def openpose(places: Array) -> Any:
    row = np.concatenate([places, np.full((25, 1), 0.9)], axis=1).ravel().tolist()
    return {"version": 1.3, "people": [{"pose_keypoints_2d": [], "pose_keypoints_3d": row}]}


def easymocap(places: Array) -> Any:
    return [{"id": 0, "keypoints3d": places.tolist()}]


def write(folder: Path, frame: Callable[[Array], Any], name: str = "{:06d}.json", left_out: int = -1) -> None:
    folder.mkdir()
    for number, places in enumerate(joints(SHOWN, BODY_25)):
        if number != left_out:
            (folder / name.format(number)).write_text(json.dumps(frame(places)))


@pytest.mark.parametrize(
    ("frame", "name"),
    [(openpose, "walk_{:012d}_keypoints.json"), (easymocap, "{:06d}.json"), (easymocap, "frame_{}.json")],
)
def test_frames_in_the_order_of_their_numbers(
    frame: Callable[[Array], Any], name: str, tmp_path: Path
) -> None:
    write(tmp_path / "frames", frame, name, left_out=7)
    clip = recognise.read(tmp_path / "frames")
    there = np.delete(np.arange(FRAMES), 7)
    assert clip.times == pytest.approx(there / 30.0)
    truth = SHOWN.joints[:, [NODE_INDEX[node] for node in clip.skeleton.names]][there]
    assert clip.positions == pytest.approx(truth, abs=1e-6)
    assert clip.provenance["source"] == "frames"
    assert find_files([tmp_path]) == [tmp_path / "frames"]


def test_a_damaged_frame_is_named(tmp_path: Path) -> None:
    write(tmp_path / "frames", openpose)
    (tmp_path / "frames" / "000012.json").write_text('{"people": [')
    with pytest.raises(CaptureError, match=r"000012\.json.* expected JSON"):
        recognise.read(tmp_path / "frames")


def test_captures_with_numbers_are_no_frames(tmp_path: Path) -> None:
    for number in range(12):
        (tmp_path / f"walk_{number:02d}.json").write_bytes(files(60)["joints.json"])
    assert not is_folder_of_frames(tmp_path)
    assert len(find_files([tmp_path])) == 12


def test_hidden_files_do_not_count(tmp_path: Path) -> None:
    """File managers leave them behind."""
    write(tmp_path / "frames", openpose)
    (tmp_path / "frames" / ".DS_Store").write_bytes(b"\0\0\0\1Bud1")
    assert find_files([tmp_path]) == [tmp_path / "frames"]
    assert len(recognise.read(tmp_path / "frames").times) == FRAMES


def test_folders_that_are_none(tmp_path: Path) -> None:
    assert not is_folder_of_frames(tmp_path / "missing")
    (tmp_path / "file").write_text("{}")
    assert not is_folder_of_frames(tmp_path / "file")
    for number in range(12):
        (tmp_path / f"{number:03d}.json").symlink_to(tmp_path / "missing")
    assert not is_folder_of_frames(tmp_path)


def test_more_frames_than_a_capture_has(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path / "frames", openpose)
    monkeypatch.setattr(frame_files, "MAX_BYTES", 2**15)
    with pytest.raises(CaptureError, match="expected frames of at most 0 MB, found more"):
        recognise.read(tmp_path / "frames")
