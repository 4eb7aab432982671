"""Written files are read by our own readers, by third-party parsers, and by the target programs."""

from __future__ import annotations

import csv
import importlib.util
import json
import sys
import types
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bvh import Bvh
from samples.motion import rigid_walk, seen_clip, walk
from scipy.spatial.transform import Rotation

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import (
    angle_between,
    from_axis_angle,
    multiply,
)
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES, Skeleton
from kinemimic.pipeline.readers.mocap.deepmimic import read_deepmimic, stock_motion
from kinemimic.pipeline.readers.recognise import read
from kinemimic.pipeline.writers.bvh import write_bvh
from kinemimic.pipeline.writers.csv import write_csv
from kinemimic.pipeline.writers.deepmimic import write_deepmimic
from kinemimic.pipeline.writers.mot import write_mot
from kinemimic.pipeline.writers.npz import write_npz
from kinemimic.pipeline.writers.poses import Poses, poses_of_clip
from kinemimic.pipeline.writers.trc import write_trc

SHOWN = rigid_walk(40, 60.0)
POSES = Poses.rigid(SHOWN.skeleton, 60.0, SHOWN.root, SHOWN.rotations)


def seen() -> Clip:
    """The walk as a sensor sees it, with a hand that is missing in three frames."""
    return seen_clip(walk(40).joints, 100.0 + np.arange(40) / 30.0, lost=slice(5, 8))


def parsed(path: Path) -> dict[str, Array]:
    """Joint positions (T, 3) in metres, our axes, by name: the third party's parser, and Euler's angles."""
    mocap = Bvh(path.read_text())
    found: dict[str, tuple[Array, Rotation]] = {}
    for name in mocap.get_joints_names():
        channels = mocap.joint_channels(name)
        values = np.array(mocap.frames_joint_channels(name, channels))
        turns = [k for k, channel in enumerate(channels) if channel.endswith("rotation")]
        order = "".join(channels[k][0] for k in turns)
        turn = Rotation.from_euler(order, values[:, turns], degrees=True)
        place = np.tile(mocap.joint_offset(name), (len(values), 1))
        for k, channel in enumerate(channels):
            if channel.endswith("position"):
                place[:, "XYZ".index(channel[0])] = values[:, k]
        parent = mocap.joint_parent(name)
        if parent is None:
            found[name] = place, turn
        else:
            at, above = found[parent.name]
            found[name] = at + above.apply(place), above * turn
    # X left, Y up, Z forward, centimetres.
    return {name: place[:, [2, 0, 1]] / 100.0 for name, (place, _) in found.items()}


@pytest.mark.parametrize("order", ["YZX", "ZXY"])
def test_bvh_by_a_third_partys_parser(tmp_path: Path, order: str) -> None:
    write_bvh(tmp_path / "walk.bvh", POSES, order=order)
    found = parsed(tmp_path / "walk.bvh")
    assert set(found) == set(NODES)
    for node, places in found.items():
        np.testing.assert_allclose(places, SHOWN.joints[:, NODE_INDEX[node]], atol=1e-6)


@pytest.mark.parametrize("order", ["YZX", "ZXY", "XYZ"])
@pytest.mark.parametrize("angle", [-0.5 * np.pi, 0.5 * np.pi])
def test_bvh_at_gimbal_lock_has_its_joints_where_they_were(tmp_path: Path, order: str, angle: float) -> None:
    """The middle angle of two joints is ±90° while the first angle goes through 80°."""
    axis = {"X": "Y", "Y": "Z", "Z": "X"}  # of the file in ours
    first, middle = from_axis_angle(axis[order[0]], np.linspace(-0.7, 0.7, 9)), axis[order[1]]
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (9, len(NODES), 1))
    for node in ("hip_center", "shoulder_left"):
        rotations[:, NODE_INDEX[node]] = multiply(first, from_axis_angle(middle, angle))
    poses = Poses.rigid(SHOWN.skeleton, 60.0, SHOWN.root[:9], rotations)
    write_bvh(tmp_path / "locked.bvh", poses, order=order)
    for node, places in parsed(tmp_path / "locked.bvh").items():
        np.testing.assert_allclose(places, poses.kinematics()[0][:, NODE_INDEX[node]], atol=1e-6)


def test_bvh_of_a_turn_of_540_degrees_is_that_turn_in_every_frame(tmp_path: Path) -> None:
    """Its angles are principal values, at most 180°; the turn that they give is the same."""
    turn = from_axis_angle("Z", np.linspace(0.0, 3.0 * np.pi, 37))
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (37, len(NODES), 1))
    rotations[:, 0] = turn
    poses = Poses.rigid(SHOWN.skeleton, 60.0, SHOWN.root[:37], rotations)
    write_bvh(tmp_path / "turn.bvh", poses)
    channels = np.array(Bvh((tmp_path / "turn.bvh").read_text()).frames_joint_channels(
        "hip_center", ["Yrotation", "Zrotation", "Xrotation"]
    ))  # fmt: skip
    assert np.abs(channels).max() <= 180.0
    steps = np.mod(np.diff(channels[:, 0]) + 180.0, 360.0) - 180.0
    np.testing.assert_allclose(steps, 15.0, atol=1e-5)
    np.testing.assert_allclose(channels[:, 1:], 0.0, atol=1e-5)


def test_bvh_of_a_capture_has_its_joints_where_they_were_seen(tmp_path: Path) -> None:
    clip = seen()
    poses = poses_of_clip(clip)
    write_bvh(tmp_path / "seen.bvh", poses)
    for node, places in parsed(tmp_path / "seen.bvh").items():
        there = np.isfinite(clip.positions[:, NODE_INDEX[node], 0])
        np.testing.assert_allclose(places[there], clip.positions[there, NODE_INDEX[node]], atol=1e-6)
    back = read(tmp_path / "seen.bvh")
    index = [back.skeleton.index(node) for node in NODES]
    np.testing.assert_allclose(back.positions[:, index], poses.kinematics()[0], atol=1e-6)


def test_bvh_as_blenders_importer_takes_it(tmp_path: Path) -> None:
    """Blender splits lines at white space and pairs braces line by line; names are words."""
    skeleton = Skeleton(("left hip", "left hip_end"), (-1, 0), np.array([[0.0, 0, 0], [0, 0, -0.4]]))
    turns = from_axis_angle("Y", np.array([0.1, 0.2]))[:, None].repeat(2, axis=1)
    turns[:, 1] = [0.0, 0.0, 0.0, 1.0]
    write_bvh(tmp_path / "a.bvh", Poses.rigid(skeleton, 30.0, np.ones((2, 3)), turns))
    lines = [line.split() for line in (tmp_path / "a.bvh").read_text().splitlines()]
    assert lines[:4] == [["HIERARCHY"], ["ROOT", "left_hip"], ["{"], ["OFFSET", *["0.000000"] * 3]]
    assert lines[4][:5] == ["CHANNELS", "6", "Xposition", "Yposition", "Zposition"]
    assert [line for line in lines if line[0] in ("End", "{", "}")] == [
        ["{"],
        ["End", "Site"],
        ["{"],
        ["}"],
        ["}"],
    ]
    motion = lines.index(["MOTION"])
    assert lines[motion + 1] == ["Frames:", "2"]
    assert lines[motion + 2][:2] == ["Frame", "Time:"] and float(lines[motion + 2][2]) == pytest.approx(
        1 / 30
    )
    assert all(len(row) == 6 for row in lines[motion + 3 :])


def test_trc_comes_back_with_its_gaps(tmp_path: Path) -> None:
    clip = seen()
    write_trc(tmp_path / "seen.trc", clip)
    text = (tmp_path / "seen.trc").read_text().split("\n")
    header = dict(zip(text[1].split("\t"), text[2].split("\t"), strict=True))
    assert (header["NumFrames"], header["NumMarkers"], header["Units"]) == ("40", "20", "mm")
    assert {header[name] for name in ("DataRate", "CameraRate", "OrigDataRate")} == {"30"}
    assert len(text[3].split("\t")) == len(text[6].split("\t")) == 2 + 3 * 20
    back = read(tmp_path / "seen.trc")
    index = [back.skeleton.index(node) for node in NODES]
    np.testing.assert_allclose(back.positions[:, index], clip.positions, atol=1e-7)
    np.testing.assert_allclose(back.times, clip.times - 100.0, atol=1e-6)
    # X forward, Y up, Z right, millimetres: the head is high, the walk goes along X.
    row = np.array([float(cell) if cell else np.nan for cell in text[6].split("\t")[2:]]).reshape(20, 3)
    np.testing.assert_allclose(
        row[NODE_INDEX["head"]], 1e3 * clip.positions[0, 3, [0, 2, 1]] * [1, 1, -1], atol=1e-4
    )


def test_npz_comes_back_and_is_the_same_every_time(tmp_path: Path) -> None:
    poses = poses_of_clip(seen())
    write_npz(tmp_path / "a.npz", poses)
    write_npz(tmp_path / "b.npz", poses)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    with np.load(tmp_path / "a.npz", allow_pickle=False) as data:
        found = dict(data)
    names = [str(found["root_name"]), *found["joint_names"].tolist()]
    assert tuple(names) == NODES
    parents = [-1, *(names.index(parent) for parent in found["joint_parents"])]
    skeleton = Skeleton(tuple(names), tuple(parents), np.zeros((20, 3)))
    back = Poses(
        skeleton,
        float(found["frame_rate"]),
        np.concatenate([found["root_position"][:, None], found["joint_offsets"]], axis=1),
        np.concatenate([found["root_rotation"][:, None], found["joint_rotations"]], axis=1),
    )
    assert back.rate == pytest.approx(30.0)
    np.testing.assert_array_equal(back.kinematics()[0], poses.kinematics()[0])


def test_csv_writes_a_joint_called_root_once(tmp_path: Path) -> None:
    clip = seen()
    clip = replace(clip, skeleton=replace(clip.skeleton, names=("root", *NODES[1:])))
    write_csv(tmp_path / "a.csv", clip, {"knee_left": np.zeros(40)})
    head, first, *_ = csv.reader((tmp_path / "a.csv").open(newline=""))
    assert len(head) == len(set(head)) == len(first) == 1 + 7 * len(NODES) + 1
    assert head[1:5] == ["root_x_m", "root_y_m", "root_z_m", "root_qx"]
    np.testing.assert_allclose([float(x) for x in first[1:4]], clip.positions[0, 0], atol=1e-6)


def test_csv_comes_back_with_empty_cells_where_nothing_was_seen(tmp_path: Path) -> None:
    clip = seen()
    angles = {"knee_left": np.linspace(0.0, 1.0, 40)}
    write_csv(tmp_path / "a.csv", clip, angles)
    with (tmp_path / "a.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert list(rows[0])[:5] == ["time_s", "root_x_m", "root_y_m", "root_z_m", "hip_center_x_m"]
    assert rows[6]["hand_left_x_m"] == ""
    table = {name: np.array([float(row[name] or "nan") for row in rows]) for name in rows[0]}
    np.testing.assert_allclose(table["time_s"], clip.times, atol=1e-6)
    np.testing.assert_allclose(np.radians(table["knee_left_deg"]), angles["knee_left"], atol=1e-6)
    assert clip.rotations is not None
    for j, node in enumerate(NODES):
        places = np.stack([table[f"{node}_{axis}_m"] for axis in "xyz"], axis=-1)
        turns = np.stack([table[f"{node}_q{axis}"] for axis in "xyzw"], axis=-1)
        np.testing.assert_allclose(places, clip.positions[:, j], atol=1e-6)
        np.testing.assert_allclose(turns, clip.rotations[:, j], atol=1e-8)
    np.testing.assert_array_equal(table["root_z_m"], table["hip_center_z_m"])


def test_a_name_with_a_comma_is_quoted(tmp_path: Path) -> None:
    skeleton = Skeleton(("hip, left",), (-1,), np.zeros((1, 3)))
    clip = Poses.rigid(skeleton, 30.0, np.zeros((2, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (2, 1, 1))).clip()
    write_csv(tmp_path / "a.csv", clip, {})
    rows = list(csv.reader((tmp_path / "a.csv").open(newline="")))
    assert rows[0][4] == "hip, left_x_m" and {len(row) for row in rows} == {11}


@pytest.mark.parametrize("name", ["walk", "run"])
def test_the_stock_motions_are_written_as_they_were_read(tmp_path: Path, name: str) -> None:
    stock = json.loads(stock_motion(name).read_text())
    clip = read_deepmimic(stock_motion(name))
    path = tmp_path / "motion.txt"
    write_deepmimic(path, poses_of_clip(clip), loop=True)
    found = json.loads(path.read_text())
    assert found["Loop"] == stock["Loop"]
    ours, theirs = np.array(found["Frames"]), np.array(stock["Frames"])
    hinges = [20, 29, 34, 43]
    np.testing.assert_allclose(ours[:, [*range(4), *hinges]], theirs[:, [*range(4), *hinges]], atol=1e-5)
    for column in (4, 8, 12, 16, 21, 25, 30, 35, 39):
        q, p = ours[:, column : column + 4], theirs[:, column : column + 4]
        np.testing.assert_allclose(
            np.abs(np.sum(q * p, axis=-1)), 1.0, atol=1e-5
        )  # either sign is the same turn


def test_deepmimic_comes_back_through_our_reader(tmp_path: Path) -> None:
    offsets = SHOWN.skeleton.offsets.copy()
    offsets[1:] *= 0.8  # a child: the root is scaled up to the format's figure
    small = Skeleton(NODES, SHOWN.skeleton.parents, offsets)
    write_deepmimic(
        tmp_path / "a.json", Poses.rigid(small, 60.0, 0.8 * SHOWN.root, SHOWN.rotations), loop=False
    )
    back = read(tmp_path / "a.json")
    assert back.rotations is not None
    np.testing.assert_allclose(back.times, np.arange(40) / 60.0, atol=1e-8)
    np.testing.assert_allclose(back.positions[:, 0], SHOWN.root, atol=1e-8)
    assert angle_between(back.rotations, SHOWN.rotations).max() < 1e-7
    assert '"Loop": "none"' in (tmp_path / "a.json").read_text()


def test_the_peers_own_loader_reads_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # The package's own __init__ registers everything with the retired gym: pass it by.
    spec = importlib.util.find_spec("pybullet_envs")
    assert spec is not None and spec.submodule_search_locations is not None
    package = types.ModuleType("pybullet_envs")
    package.__path__ = list(spec.submodule_search_locations)
    monkeypatch.setitem(sys.modules, "pybullet_envs", package)
    module = importlib.import_module("pybullet_envs.deep_mimic.env.motion_capture_data")
    write_deepmimic(tmp_path / "walk.txt", POSES, loop=True)
    data = module.MotionCaptureData()
    data.Load(str(tmp_path / "walk.txt"))
    assert data.NumFrames() == 40
    assert data.getCycleTime() == pytest.approx(39 / 60)
    way = SHOWN.root[-1] - SHOWN.root[0]
    np.testing.assert_allclose(data.computeCycleOffset(), [way[0], way[2], -way[1]], atol=1e-9)


@pytest.mark.parametrize("write", [write_mot, lambda path, poses: write_deepmimic(path, poses, loop=False)])
def test_other_skeletons_than_the_20_nodes_are_refused(tmp_path: Path, write: object) -> None:
    other = replace(
        POSES, skeleton=Skeleton(("a", *NODES[1:]), SHOWN.skeleton.parents, SHOWN.skeleton.offsets)
    )
    with pytest.raises(ValueError, match="poses of the 20 nodes"):
        write(tmp_path / "a", other)  # type: ignore[operator]
    assert not (tmp_path / "a").exists()
