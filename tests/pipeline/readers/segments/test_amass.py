"""AMASS archives, written here from the known walk, and the published sample."""

from __future__ import annotations

import hashlib
import io
import pickle
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples import amass as sample
from samples.motion import rigid_walk
from samples.mutate import mutated

from kinemimic.pipeline.errors import CaptureError, KinemimicError
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.proportions import SHANK, THIGH
from kinemimic.pipeline.kinematics.rotations import from_rotvec, multiply, rotate, to_matrix, to_rotvec
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.array_files import npz
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.segments import amass
from kinemimic.pipeline.writers.bvh import write_bvh
from kinemimic.pipeline.writers.poses import poses_of_clip

FRAMES = 60
Arrays = dict[str, Any]


def read(arrays: Arrays | bytes) -> Clip:
    content = arrays if isinstance(arrays, bytes) else sample.packed(arrays)
    return recognise.read_source(Source(Path("walk.npz"), content, hashlib.sha256(content).hexdigest()))


def test_the_walk() -> None:
    clip, shown = read(sample.arrays(FRAMES)), rigid_walk(FRAMES, sample.RATE)
    positions = to_nodes(clip)[0]
    assert clip.rate == pytest.approx(120.0)
    assert np.abs(positions[:, 0] - shown.root).max() < 1e-9
    ours, own = leg_angles(positions), leg_angles(shown.joints)
    for knee in ("knee_left", "knee_right"):
        assert np.abs(ours[knee] - own[knee]).max() < np.radians(0.01)
    for a, b, share in (("hip_left", "knee_left", THIGH), ("knee_right", "ankle_right", SHANK)):
        length = np.linalg.norm(positions[:, NODE_INDEX[a]] - positions[:, NODE_INDEX[b]], axis=-1)
        assert np.abs(length - share * amass.STATURES["male"]).max() < 1e-9


def test_all_widths_and_the_layout_of_smpl_x_are_the_same_motion() -> None:
    arrays = sample.arrays(FRAMES)
    same, poses = read(arrays), arrays["poses"]
    for width in (66, 72, 165):
        other = {
            **arrays,
            "poses": np.resize(np.hstack([poses, np.zeros((FRAMES, 9))])[:, :width], (FRAMES, width)),
        }
        assert np.array_equal(read(other).positions, same.positions)
    parts = {"root_orient": poses[:, :3], "pose_body": poses[:, 3:66], "trans": arrays["trans"]}
    parts |= {"mocap_frame_rate": np.array(120.0), "gender": arrays["gender"]}
    assert np.array_equal(read(parts).positions, same.positions)
    single = {**arrays, "poses": np.asfortranarray(poses.astype(np.float32))}
    assert np.abs(read(single).positions - same.positions).max() < 1e-5


@pytest.mark.parametrize("rate", ["fps", "frame_rate", "mocap_frame_rate", "frameRate"])
def test_the_names_and_shapes_of_other_programs(rate: str) -> None:
    arrays = sample.arrays(FRAMES)
    same, poses = read(arrays), arrays["poses"][:, :72]
    root, body = poses[:, :3], poses[:, 3:]
    matrices = to_matrix(from_rotvec(poses.reshape(FRAMES, 24, 3)))
    others: list[Arrays] = [
        {"global_orient": root, "body_pose": body, "transl": arrays["trans"]},
        {"global_orient": root[:, None], "body_pose": body.reshape(FRAMES, 23, 3), "trans": arrays["trans"]},
        {"global_orient": matrices[:, :1], "body_pose": matrices[:, 1:], "transl": arrays["trans"]},
        {"poses": poses.reshape(FRAMES, 24, 3), "trans": arrays["trans"][:, None]},
        {"fullpose": poses.reshape(FRAMES, 24, 3), "transl": arrays["trans"]},
        {"smpl_poses": poses, "smpl_trans": arrays["trans"], "smpl_scaling": np.ones(1)},
        {"pose": root, "pose_world": poses, "trans": root, "trans_world": arrays["trans"]},
    ]
    for other in others:
        clip = read({**other, rate: np.array(120), "gender": np.array("male")})
        assert clip.rate == pytest.approx(120.0)
        assert np.abs(clip.positions - same.positions).max() < 1e-9
    # A gender that is a Python object is left out.
    assert "neutral" in str(read({**arrays, "gender": np.array([_Trap()])}).provenance["reading"]["notes"])


def test_a_file_that_is_y_up_stands_upright(tmp_path: Path) -> None:
    arrays = sample.arrays(FRAMES)
    upright = read(arrays)
    turn = np.array([-0.5 * np.pi, 0.0, 0.0])
    q = from_rotvec(turn)
    poses = arrays["poses"].copy()
    poses[:, :3] = to_rotvec(multiply(q, from_rotvec(poses[:, :3])))
    clip = read({**arrays, "poses": poses, "trans": rotate(q, arrays["trans"])})
    assert np.ptp((clip.positions - upright.positions)[..., 2]) < 1e-6
    # Exported and read back, its bodies are where they were.
    write_bvh(tmp_path / "walk.bvh", poses_of_clip(clip))
    back = recognise.read(tmp_path / "walk.bvh")
    for joint in ("left_ankle", "right_wrist"):
        moved = back.positions[:, back.skeleton.index(joint)] - clip.positions[:, clip.skeleton.index(joint)]
        assert np.abs(moved).max() < 1e-4


@pytest.mark.parametrize(("unit", "metres"), [("centimetres", 0.01), ("millimetres", 0.001)])
def test_a_path_in_another_unit_is_converted(unit: str, metres: float) -> None:
    arrays = sample.arrays(120)
    right = read(arrays)
    assert not right.provenance["reading"]["defects"]
    other = {**arrays, "trans": arrays["trans"] / metres}
    standing = {**other, "poses": np.repeat(arrays["poses"][:1], 120, axis=0)}
    standing["trans"] = np.repeat(other["trans"][:1], 120, axis=0)
    for stored, says in ((other, "move at"), (standing, "the pelvis would be")):
        clip = read(stored)
        (defect,) = clip.provenance["reading"]["defects"]
        assert defect["rule"] == "wrong_units"
        assert f"the path is in {unit}: " in defect["text"]
        assert says in defect["text"]
        assert np.abs(clip.positions - right.positions)[0].max() < 1e-9
        assert clip.translations is not None
        assert np.abs(clip.translations[:, 0] - metres * stored["trans"]).max() < 1e-12
    assert np.abs(read(other).positions - right.positions).max() < 1e-9


def test_a_walk_high_above_the_origin_is_in_metres() -> None:
    arrays = sample.arrays(120)
    clip = read({**arrays, "trans": arrays["trans"] + [0.0, 0.0, 91.0]})
    assert not clip.provenance["reading"]["defects"]


def test_the_unit_of_the_path_by_hand(tmp_path: Path) -> None:
    arrays = sample.arrays(FRAMES)
    (tmp_path / "walk.npz").write_bytes(sample.packed({**arrays, "trans": arrays["trans"] / 0.0254}))
    clip = recognise.read(tmp_path / "walk.npz", unit="inch")
    assert np.abs(clip.positions - read(arrays).positions).max() < 1e-9
    assert clip.provenance["reading"]["units_rule"] == "set by --unit"


def test_what_is_not_known_is_said() -> None:
    arrays = sample.arrays(FRAMES)
    del arrays["mocap_framerate"], arrays["gender"]
    notes = " ".join(read(arrays).provenance["reading"]["notes"])
    assert "no rate in the file: 30 Hz" in notes
    assert "average neutral body, 1.69 m tall" in notes


def without(name: str) -> Callable[[Arrays], Arrays]:
    return lambda arrays: {key: value for key, value in arrays.items() if key != name}


def put(name: str, value: Any) -> Callable[[Arrays], Arrays]:
    return lambda arrays: {**arrays, name: value}


def infinite(arrays: Arrays) -> Arrays:
    arrays["poses"][7, 3] = np.inf
    return arrays


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (without("trans"), r"an \.npz archive of .*; an SMPL body's motion has trans and poses"),
        (put("trans", np.zeros((5, 3))), r"expected trans of shape \(60, 3\), as poses, found \(5, 3\)"),
        (
            put("poses", np.zeros((60, 99))),
            r"expected poses of shape \(frames, 66, 72, 156, 165\), found \(60, 99\)",
        ),
        (
            put("poses", np.zeros((60, 24, 3, 3))),
            "frame 0: expected rotation matrices in poses, found none at joint 0",
        ),
        (put("poses", np.array([["a"] * 66])), "expected numbers in poses, found <U1"),
        (
            put("mocap_framerate", np.array(0.0)),
            r"expected a rate of 1 to 1000 Hz in mocap_framerate, found \[0.0\]",
        ),
        (
            put("trans", np.full((60, 3), 1e6)),
            r"frame 0: expected metres of at most 1e\+05 in trans, found 1e\+06",
        ),
        (
            put("trans", np.eye(60, 3) * 1e4),
            "frame 0: expected at most 100 m in X of trans, found 10000",
        ),
        (infinite, "frame 7: expected radians of at most 25.13 in poses, found inf"),
        (put("trans", np.array([object()])), r"expected numbers or words in trans, found"),
    ],
)
def test_damage_is_named(change: Callable[[Arrays], Arrays], says: str) -> None:
    with pytest.raises(CaptureError, match=says):
        read(change(sample.arrays(FRAMES)))


class _Trap:
    def __reduce__(self) -> tuple[Any, ...]:
        return pytest.fail, ("it was unpickled",)


def test_nothing_is_unpickled_or_larger_than_it_claims(monkeypatch: pytest.MonkeyPatch) -> None:
    arrays = sample.arrays(FRAMES)
    with pytest.raises(CaptureError, match="expected numbers or words in fps"):
        read({**arrays, "fps": np.array([_Trap()])})
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("poses.npy", pickle.dumps(_Trap()))
        archive.writestr("trans.npy", b"")
    with pytest.raises(CaptureError, match=r"expected poses\.npy of version 1 or 2"):
        read(stream.getvalue())
    # An archive whose header claims a thousand times what follows it, and one that unpacks to too much.
    content = sample.packed(arrays).replace(b"(60, 156)", b"(60, 999)")
    with pytest.raises(CaptureError, match=r"found damage \(Bad CRC-32"):
        read(content)
    stream = io.BytesIO()
    np.save(stream, arrays["trans"])
    claims = stream.getvalue().replace(b"(60, 3)", b"(99, 9)")
    stream = io.BytesIO(sample.packed({"poses": arrays["poses"]}))
    with zipfile.ZipFile(stream, "a") as archive:
        archive.writestr("trans.npy", claims)
    with pytest.raises(CaptureError, match=r"expected trans of shape \(99, 9\), found 1440 bytes of float64"):
        read(stream.getvalue())
    monkeypatch.setattr(npz, "MAX_ARRAY", 2**12)
    with pytest.raises(CaptureError, match="expected at most 0 MB in poses"):
        read(sample.packed(arrays))


def test_damage_within_the_arrays() -> None:
    """Two thousand archives of damaged arrays, whose checksums are right."""
    content, rng = sample.arrays(FRAMES), np.random.default_rng(2026)
    whole = {name: value for name, value in content.items() if name not in ("betas", "dmpls")}
    members: dict[str, bytes] = {}
    for name, value in whole.items():
        stream = io.BytesIO()
        np.save(stream, value)
        members[f"{name}.npy"] = stream.getvalue()
    clips = errors = 0
    for _ in range(2000):
        victim = list(members)[int(rng.integers(len(members)))]
        stream = io.BytesIO()
        with zipfile.ZipFile(stream, "w") as archive:
            for name, data in members.items():
                archive.writestr(name, mutated(data, rng) if name == victim else data)
        try:
            clip = read(stream.getvalue())
            assert np.isfinite(clip.positions).all()
            clips += 1
        except KinemimicError as error:
            assert len(str(error).splitlines()) == 1
            errors += 1
    assert errors > 1000
    assert clips > 100


def test_published_sample(sensors: Path) -> None:
    """The knees bend as the file's own rotations say, plus the bend of the rest pose."""
    path = sensors / "amass" / "amass_sample.npz"
    clip = recognise.read(path)
    assert len(clip.times) == 601
    assert clip.rate == pytest.approx(120.0)
    angles = leg_angles(to_nodes(clip)[0])
    with np.load(path, allow_pickle=False) as archive:
        poses = archive["poses"]
    for side, joint in (("left", 4), ("right", 5)):
        own = poses[:, 3 * joint]  # about the axis to the left
        off = np.degrees(angles[f"knee_{side}"] - own)
        assert 0.0 < off.min() < off.max() < 10.0
