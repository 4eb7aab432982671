"""Stage 2: quaternions that reproduce the capture, and the knee of CMU 02_01 against its own AMC curve."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples import bvh, described_euler, source_of
from samples.motion import kinect_v2_joints, walk

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.cli.main import main
from kinemimic.pipeline.convert import convert, read_converted
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import file_hash, read_json, write_clip
from kinemimic.pipeline.ingest import ingest
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.rotations import angle_between, from_axis_angle
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES, TRACKED
from kinemimic.pipeline.readers.kinect.kinect_v2 import FROM_SDK, kinect_v2_skeleton
from kinemimic.pipeline.readers.recognise import read, read_source

Text = Callable[..., str]


def amc(path: Path, bone: str) -> Array:
    """The single degree of freedom of a bone, degrees, frame by frame."""
    words = (line.split() for line in path.read_text(encoding="ascii").splitlines())
    return np.array([float(word[1]) for word in words if word[0] == bone])


def test_cmu_knee_equals_its_amc_curve(captures: Path, tmp_path: Path) -> None:
    ingest(captures / "cmu_bvh" / "02_01.bvh", tmp_path, filter_name="none")
    convert(tmp_path)
    clip = read_converted(tmp_path)
    knees = leg_angles(to_nodes(clip)[0])
    for side in ("left", "right"):
        truth = amc(captures / "cmu_asfamc" / "02_01.amc", f"{side[0]}tibia")
        assert len(truth) == len(clip.times) == 343
        assert np.abs(np.degrees(knees[f"knee_{side}"]) - truth).max() < 0.05


def test_cmu_run_too(captures: Path, tmp_path: Path) -> None:
    ingest(captures / "cmu_bvh" / "02_03.bvh", tmp_path, filter_name="none")
    knees = leg_angles(to_nodes(convert(tmp_path))[0])
    truth = amc(captures / "cmu_asfamc" / "02_03.amc", "rtibia")
    assert np.abs(np.degrees(knees["knee_right"]) - truth).max() < 0.05


@pytest.mark.parametrize(("take", "limit"), [("02_01", 0.2), ("02_03", 0.3)])
def test_the_default_filter_leaves_an_optical_knee_alone(
    captures: Path, tmp_path: Path, take: str, limit: float
) -> None:
    """The filter finds hardly any noise in this clip and removes no more: degrees, in any frame."""
    ingest(captures / "cmu_bvh" / f"{take}.bvh", tmp_path)
    knees = leg_angles(to_nodes(convert(tmp_path))[0])
    for side in ("left", "right"):
        truth = amc(captures / "cmu_asfamc" / f"{take}.amc", f"{side[0]}tibia")
        change = np.degrees(knees[f"knee_{side}"]) - truth
        assert np.abs(change).max() < limit
        assert np.sqrt(np.mean(change**2)) < 0.06


def test_quaternions_put_every_joint_where_the_channels_put_it(tmp_path: Path, bvh: Text) -> None:
    (tmp_path / "a.bvh").write_text(bvh())
    before = ingest(tmp_path / "a.bvh", tmp_path / "run")
    after = convert(tmp_path / "run")
    assert after.rotations is not None
    assert np.allclose(after.positions, before.positions, atol=1e-12)
    assert np.allclose(np.linalg.norm(after.rotations, axis=-1), 1.0)
    assert (np.sum(after.rotations[1:] * after.rotations[:-1], axis=-1) >= 0).all()
    stored = read_converted(tmp_path / "run")
    assert np.array_equal(stored.rotations, after.rotations)
    assert stored.provenance["stage"] == "convert"
    assert stored.provenance["inputs"]["clip"] == file_hash(tmp_path / "run" / "clip.parquet")


def test_filtered_rotations_are_kept(tmp_path: Path, bvh: Text) -> None:
    (tmp_path / "a.bvh").write_text(bvh())
    before = ingest(tmp_path / "a.bvh", tmp_path / "run", filter_name="butterworth")
    after = convert(tmp_path / "run")
    assert np.array_equal(after.rotations, before.rotations)
    assert np.allclose(after.positions, before.positions, atol=1e-12)


def test_positions_get_orientations(tmp_path: Path, skl: Text) -> None:
    (tmp_path / "a.skl").write_text(skl(60))
    before = ingest(tmp_path / "a.skl", tmp_path / "run")
    after = convert(tmp_path / "run")
    assert after.rotations is not None and after.rotations.shape == (60, 20, 4)
    assert np.array_equal(after.positions, before.positions)
    assert read_json(tmp_path / "run" / "gimbal.json")["joints"] == []


def kinect_v2_clip(rotations: Array | None = None) -> Clip:
    shown = walk(30)
    joints = kinect_v2_joints(shown)[:, FROM_SDK]
    return Clip(
        skeleton=kinect_v2_skeleton(),
        times=shown.times,
        positions=joints,
        states=np.full(joints.shape[:2], TRACKED, dtype=np.uint8),
        passes=np.zeros(len(joints), dtype=np.int32),
        rotations=rotations,
        provenance={"source": "made here"},
    )


def test_positions_on_another_skeleton_are_mapped_to_the_nodes(tmp_path: Path) -> None:
    clip = kinect_v2_clip()
    write_clip(tmp_path / "clip.parquet", clip)
    converted = convert(tmp_path)
    assert converted.skeleton.names == NODES
    assert converted.rotations is not None
    assert np.isfinite(converted.rotations).all()
    for node, joint in {
        "hip_center": "SpineBase",
        "shoulder_center": "SpineShoulder",
        "foot_left": "FootLeft",
    }.items():
        assert np.array_equal(
            converted.positions[:, NODE_INDEX[node]], clip.positions[:, clip.skeleton.index(joint)]
        ), node


def test_recorded_quaternions_are_kept(tmp_path: Path) -> None:
    turns = from_axis_angle("Y", 0.01 * np.arange(30)[:, None] * np.ones(25))
    write_clip(tmp_path / "clip.parquet", kinect_v2_clip(turns))
    converted = convert(tmp_path)
    assert converted.skeleton.names == kinect_v2_skeleton().names
    assert converted.rotations is not None
    assert np.array_equal(converted.rotations, turns)


def test_a_planted_lock_is_named_with_its_frames(
    tmp_path: Path, bvh: Text, capsys: pytest.CaptureFixture[str]
) -> None:
    motion = 3.0 * np.sin(0.2 * np.arange(60)[:, None] + np.arange(37))
    elbow = 6 + 3 * 4  # first channel of LeftForeArm, whose order is that of Eq. 8
    motion[20:26, elbow + 1] = [86, 89, 90, 90, 89, 86]
    (tmp_path / "a.bvh").write_text(bvh(motion=motion))
    ingest(tmp_path / "a.bvh", tmp_path / "run")
    with pytest.raises(SystemExit) as caught:
        main(["convert", "--run", str(tmp_path / "run")])
    assert not caught.value.code
    report = read_json(tmp_path / "run" / "gimbal.json")
    marked = [joint for joint in report["joints"] if joint["flagged_frames"]]
    assert [(joint["joint"], joint["order"]) for joint in marked] == [("LeftForeArm", "YZX (Eq. 8)")]
    assert marked[0]["flagged_frames"] == [[20, 25]]
    assert marked[0]["nearest_deg"] == pytest.approx(0.0, abs=1e-9)
    line = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("LeftForeArm"))
    assert "YZX (Eq. 8)" in line and "20-25" in line
    with pytest.raises(SystemExit):
        main(["convert", "--run", str(tmp_path / "run"), "--json"])
    assert json.loads(capsys.readouterr().out) == report


def test_without_a_clip_the_error_gives_advice(tmp_path: Path) -> None:
    with pytest.raises(KinemimicError, match="expected a clip, found no file; run `kinemimic ingest` first"):
        convert(tmp_path)
    with pytest.raises(KinemimicError, match="expected a run folder, found none"):
        convert(tmp_path / "nothing")
    assert not (tmp_path / "nothing").exists()


def test_names_that_look_like_markup_are_names(
    tmp_path: Path, bvh: Text, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.bvh").write_text(
        bvh().replace("JOINT Head", "JOINT Head[/l]").replace("JOINT Neck", "JOINT Neck[/l]")
    )
    for arguments in (["ingest", str(tmp_path / "a.bvh")], ["convert"]):
        with pytest.raises(SystemExit) as ended:
            main([*arguments, "--run", str(tmp_path / "run")])
        assert ended.value.code == 0
    assert "Neck[/l]" in capsys.readouterr().out


@pytest.mark.parametrize("filter_name", ["kalman", "butterworth", "one-euro", "none"])
def test_an_empty_euler_cell_is_a_missing_joint_and_not_an_error(tmp_path: Path, filter_name: str) -> None:
    whole = read_source(source_of(bvh.files(90)["walk.bvh"].decode(), Path("walk.bvh")))
    names = whole.skeleton.names
    knee, elbow = names.index("knee_left"), names.index("elbow_left")
    never = names.index("elbow_right")
    # One cell; a longer gap than is filled; and a joint without any angle.
    gaps = {(20, knee, 1)} | {(k, elbow, 0) for k in range(30, 70)} | {(k, never, 1) for k in range(90)}
    capture = described_euler.write(tmp_path, whole, frozenset(gaps))

    recorded = read(capture)
    missing = recorded.states == 0
    # What hangs on a joint without an angle is unknown, too.
    arm = {"elbow_right", "wrist_right", "hand_right", "hand_right_end"}
    leg = {"knee_left", "ankle_left", "foot_left", "foot_left_end"}
    assert {names[joint] for joint in np.flatnonzero(missing[20])} == arm | leg
    assert missing[30:70, elbow].all() and not missing[30:70, knee].any()
    assert np.array_equal(np.isnan(recorded.positions).any(axis=-1), missing)

    cleaned = ingest(capture, tmp_path, filter_name=filter_name)
    converted = convert(tmp_path)
    assert converted.rotations is not None and cleaned.rotations is not None
    expected = ingest(described_euler.write(tmp_path, whole), tmp_path / "whole", filter_name=filter_name)
    true = convert(tmp_path / "whole").rotations
    assert true is not None
    assert np.degrees(angle_between(converted.rotations[20, knee], true[20, knee])) < 1.0
    assert converted.states[20].tolist()[knee] == 1
    assert np.isnan(converted.rotations[30:70, elbow]).all()
    assert (converted.states[30:70, elbow] == 0).all()
    assert np.linalg.norm(converted.positions[20, knee] - expected.positions[20, knee]) < 0.01

    report = {joint["joint"]: joint for joint in read_json(tmp_path / "gimbal.json")["joints"]}
    assert "elbow_right" not in report
    angles = recorded.euler
    assert angles is not None
    nearest = np.nanmin(np.abs(np.abs(np.degrees(angles[:, elbow, 1])) - 90.0))
    assert report["elbow_left"]["nearest_deg"] == pytest.approx(nearest, abs=1e-5)
    assert not 30 <= report["elbow_left"]["nearest_frame"] < 70
    assert main_status("convert", "--run", str(tmp_path)) == 0


def main_status(*arguments: str) -> int:
    with pytest.raises(SystemExit) as caught:
        main(list(arguments))
    return int(caught.value.code or 0)
