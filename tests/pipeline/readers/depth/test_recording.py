"""A whole recording of the known walk, read like any capture."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from samples.depth_scene import HALF, joints_csv, png, to_camera, walker, write_recording

from kinemimic.pipeline.convert import convert
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.ingest import ingest
from kinemimic.pipeline.kinematics.skeleton import NODE_PARENTS, NODES
from kinemimic.pipeline.readers.depth.folder import numbered_images
from kinemimic.pipeline.readers.depth.recording import read_recording, skeleton_of
from kinemimic.pipeline.readers.recognise import formats, read
from kinemimic.retarget.command import retarget

FRAMES = 50


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("depth") / "walk"
    write_recording(folder, FRAMES)
    return folder


@pytest.fixture
def short(tmp_path: Path) -> Path:
    """Four frames of a room with nobody in it, to be damaged."""
    write_recording(tmp_path / "short", 4, rendered=False)
    return tmp_path / "short"


def test_the_walk_comes_back_within_2_mm(walk: Path) -> None:
    clip = read(walk)
    off = np.linalg.norm(clip.positions - walker(FRAMES), axis=-1)
    assert np.isfinite(off).all()
    assert off.max() < 0.002
    assert clip.skeleton.names == NODES
    assert clip.rate == pytest.approx(30.0)
    assert clip.provenance["source"] == "walk"
    facts = clip.provenance["reading"]
    assert facts["complete_frames"] == FRAMES
    assert sum(facts["joint_positions"].values()) == FRAMES * len(NODES)
    # Thin limbs and occluded joints are at depth edges; the trunk never is.
    assert (clip.states[:, :3] == 2).all()
    assert 0 < facts["joint_positions"]["at a depth edge"] < 0.15 * clip.states.size


def test_without_given_depth_joints_lie_on_the_skin(tmp_path: Path) -> None:
    joints = write_recording(tmp_path / "skin", 12, with_depth=False)
    clip = read_recording(tmp_path / "skin")
    sensor = np.array([0.0, 0.0, 1.0])
    depth, skin = (np.linalg.norm(p - sensor, axis=-1) for p in (joints, clip.positions))
    inside = (depth - skin)[clip.states == 2]
    assert len(inside) > 0.8 * clip.states.size
    # Behind the skin by no more than the trunk's 0.13 m, or another limb's before it.
    assert inside.min() > -0.01
    assert np.quantile(inside, 0.9) < 0.14
    assert any("on the skin" in note for note in clip.provenance["reading"]["notes"])


def test_a_dead_patch_makes_its_joints_missing_and_its_frames_incomplete(tmp_path: Path) -> None:
    frames, dead = 10, range(3, 6)
    pixels = HALF.project(to_camera(walker(frames)))
    head = NODES.index("head")

    def damage(frame: int, image: NDArray[np.uint16]) -> NDArray[np.uint16]:
        u, v = np.rint(pixels[frame, head]).astype(int)
        if frame in dead:
            image[v - 6 : v + 7, u - 6 : u + 7] = 0
        return image

    write_recording(tmp_path / "dead", frames, damage=damage)
    clip = read_recording(tmp_path / "dead")
    expected = np.zeros((frames, len(NODES)), dtype=np.bool_)
    expected[list(dead), head] = True
    assert ((clip.states == 0) == expected).all()
    assert (np.isnan(clip.positions).all(axis=-1) == expected).all()
    assert clip.provenance["reading"]["complete_frames"] == frames - len(dead)


def test_ingest_convert_and_retarget_work_on_it(walk: Path, tmp_path: Path) -> None:
    cleaned = ingest(walk, tmp_path)
    assert (cleaned.passes == 0).all()
    # The 6 Hz filter attenuates the swing of a foot by some millimetres, more at the ends of a pass.
    assert np.median(np.linalg.norm(cleaned.positions - walker(FRAMES), axis=-1)) < 0.005
    convert(tmp_path)
    assert len(retarget(tmp_path).root) > 0


def test_a_name_is_any_that_is_known_and_the_state_can_only_fall(short: Path) -> None:
    text = (short / "joints.csv").read_text().replace("hip_center", "pelvis").replace("head", "Head")
    lines = text.splitlines()
    states = [lines[0] + ",state", *(f"{line},{k % 3}" for k, line in enumerate(lines[1:]))]
    before = read_recording(short).states.ravel()
    (short / "joints.csv").write_text("\n".join(states))
    clip = read_recording(short)
    assert clip.skeleton.names == NODES
    assert clip.states.ravel().tolist() == np.minimum(before, np.arange(before.size) % 3).tolist()


def test_joints_beyond_the_nodes_keep_their_names(short: Path) -> None:
    skeleton, order = skeleton_of(("nose", "KneeLeft", "Pelvis", "HipLeft"))
    assert skeleton.names == ("Pelvis", "HipLeft", "KneeLeft", "nose")
    assert skeleton.parents == (-1, 0, 1, 0)
    assert order == [2, 3, 1, 0]
    assert skeleton_of(("a", "b"))[0].parents == (-1, 0)
    assert skeleton_of(tuple(reversed(NODES)))[0].parents == NODE_PARENTS


def test_dropped_frames_leave_gaps_in_time(short: Path) -> None:
    (short / "depth" / "000002.png").rename(short / "depth" / "000009_tick.png")
    clip = read_recording(short)
    assert clip.times == pytest.approx(np.array([0, 1, 3, 9]) / 30.0)
    assert (clip.states[3] == 0).all()
    assert any(
        "1 frames of joints.csv have no depth image" in note for note in clip.provenance["reading"]["notes"]
    )


def test_times_come_from_their_file(short: Path) -> None:
    text = (short / "camera.toml").read_text()
    (short / "times.csv").write_text("frame,time\n0,100.0\n1,100.04\n2,100.07\n3,100.1\n")
    with pytest.raises(CaptureError, match=r"either a rate in camera.toml or times.csv, found both"):
        read_recording(short)
    (short / "camera.toml").write_text(text.replace("rate = 30.0", ""))
    assert read_recording(short).times == pytest.approx([100.0, 100.04, 100.07, 100.1])
    (short / "times.csv").unlink()
    with pytest.raises(CaptureError, match="found neither"):
        read_recording(short)


def test_the_hash_is_of_everything_that_was_read(short: Path) -> None:
    first = read(short).provenance["sha256"]
    assert read(short).provenance["sha256"] == first
    image = np.full((HALF.height, HALF.width), 3000, dtype=np.uint16)
    (short / "depth" / "000003.png").write_bytes(png(image))
    second = read(short).provenance["sha256"]
    (short / "joints.csv").write_text(joints_csv(HALF.project(to_camera(walker(4))), None))
    assert len({first, second, read(short).provenance["sha256"]}) == 3


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("camera.toml", b"\x00\x01", "expected TOML, found a binary file"),
        ("camera.toml", b"", "empty file"),
        ("joints.csv", None, "joints.csv: expected a capture file, found no file"),
        (
            "depth/000002.png",
            b"\x89PNG\r\n\x1a\n",
            "000002.png: expected a complete PNG, found a truncated one",
        ),
        ("depth/000002x.png", b"", "frame 2: expected one image per frame"),
    ],
)
def test_damage_is_one_line(short: Path, name: str, content: bytes | None, message: str) -> None:
    if content is None:
        (short / name).unlink()
    else:
        (short / name).write_bytes(content)
    with pytest.raises(CaptureError, match=message):
        read(short)


def test_its_unit_is_not_for_the_command_line_to_say(short: Path) -> None:
    with pytest.raises(CaptureError, match=r"expected its unit in camera.toml, found --unit"):
        read(short, unit="mm")


def test_missing_images_and_recordings_are_reported(short: Path, tmp_path: Path) -> None:
    shutil.rmtree(short / "depth")
    with pytest.raises(CaptureError, match="expected depth images named by their frame"):
        read(short)
    with pytest.raises(CaptureError, match="expected a capture file, found a folder"):
        read(tmp_path)
    assert "depth recording" in [one.name for one in formats()]


def test_pipes_and_strangers_are_passed_over(short: Path) -> None:
    os.mkfifo(short / "depth" / "000099.png")
    (short / "depth" / "000098.txt").write_text("no image")
    (short / "depth" / "thumbnail.png").write_text("no number")
    assert list(numbered_images(short / "depth", (".png",))) == [0, 1, 2, 3]
    assert numbered_images(short / "nowhere", (".png",)) == {}
