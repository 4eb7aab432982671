"""What exported files contain: every motion in every format, read back, agrees with its source."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from peers.exported import FRAMES, captured, of
from samples.converted import write_converted

from kinemimic.evaluate.export.both import pair_of_run
from kinemimic.evaluate.export.files import export
from kinemimic.evaluate.export.motion_source import SOURCES, source_of_mcap, sources_of_run
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.sidecars import note_path
from kinemimic.pipeline.gait.curve_metrics import joint_fits
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.orientation.rest_pose import recorded_knees
from kinemimic.pipeline.kinematics.rotations import (
    angle_between,
    conjugate,
    from_axis_angle,
    from_rotvec,
    multiply,
)
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.pipeline.readers.mocap.deepmimic import read_deepmimic
from kinemimic.pipeline.readers.recognise import read
from kinemimic.pipeline.writers.mot import coordinates
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.retarget.formats.read_mcap import read_mcap
from kinemimic.retarget.formats.write_mcap import write_mcap
from kinemimic.retarget.humanoid.motion import Motion, joint_angles
from kinemimic.train.rollout.trajectory import Trajectory


@pytest.mark.parametrize("what", list(SOURCES))
def test_positions_agree_across_formats(run: Path, files: list[dict[str, object]], what: str) -> None:
    source = sources_of_run(run)[what]
    expected, _ = source.poses.kinematics()
    for form in ("bvh", "trc"):
        back = read(of(files, what, form))
        index = [back.skeleton.index(node) for node in NODES]
        wanted = source.clip.positions if form == "trc" else expected
        np.testing.assert_allclose(back.positions[:, index], wanted, atol=1e-6)
    for motion in (
        read_motion_json(of(files, what, "json")),
        read_mcap(of(files, what, "mcap")),
    ):
        # These two have rigid bones; a capture's are as long as they mostly were.
        found = motion.kinematics()[0]
        np.testing.assert_allclose(found, expected, atol=0.02 if what == "capture" else 1e-8)
    angles = read(of(files, what, "mot")).angles
    assert angles is not None
    for name, curve in source.angles.items():
        if what != "capture":  # its times are uneven, and those of a MOT even
            np.testing.assert_allclose(angles[name], curve, atol=1e-8)
    peers = read_deepmimic(of(files, what, "deepmimic"))
    told = next(r["frames"] for r in files if (r["what"], r["format"]) == (what, "deepmimic"))
    assert len(peers.times) == told == len(expected) + (what == "reference")


def test_a_cycle_is_closed_for_deepmimic(walk: Motion, files: list[dict[str, object]]) -> None:
    content = json.loads(of(files, "reference", "deepmimic").read_text())
    assert content["Loop"] == "wrap"
    first, last = np.array(content["Frames"][0]), np.array(content["Frames"][-1])
    assert len(content["Frames"]) == len(walk.root) + 1
    np.testing.assert_allclose(last[4:], first[4:], atol=1e-9)
    legs = 0.78 / 0.831416  # of the body's leg in the format's
    np.testing.assert_allclose((last - first)[1:4] * legs, [walk.cycle_offset[0], 0.0, 0.0], atol=1e-5)
    assert json.loads(of(files, "simulated", "deepmimic").read_text())["Loop"] == "none"


def test_the_capture_is_the_longest_or_the_requested_pass(run: Path, tmp_path: Path) -> None:
    clip = captured()
    source = sources_of_run(run, ["capture"])["capture"]
    np.testing.assert_allclose(source.clip.times, clip.times[30:] - clip.times[30], atol=1e-12)
    assert source.starts_at == clip.times[30]
    assert source.note("csv") == "from a SIMULATED capture; pass 1 of 2"
    assert len(sources_of_run(run, ["capture"], 0)["capture"].clip.times) == 30
    with pytest.raises(KinemimicError, match="expected pass 2, found 2 passes, counted from 0"):
        sources_of_run(run, ["capture"], 2)


def test_a_recorded_head_rotation_is_kept(tmp_path: Path) -> None:
    """A head that looks a little to the left, all the time."""
    clip, neck = captured(), NODES.index("shoulder_center")
    assert clip.rotations is not None
    turned = clip.rotations.copy()
    turned[:, neck] = from_axis_angle("Z", np.full(len(turned), 0.4))
    write_converted(tmp_path, replace(clip, rotations=turned))
    exported = sources_of_run(tmp_path)["capture"].on_nodes.rotations[:, neck]
    assert np.abs(angle_between(exported, turned[:1, neck])).max() < 1e-6


def test_the_body_is_a_tree_of_bodies(files: list[dict[str, object]]) -> None:
    robot = ET.fromstring(of(files, "humanoid", "urdf").read_text())
    joints = [joint.get("type") for joint in robot.findall("joint")]
    assert joints.count("revolute") == 3 * 14 and joints.count("fixed") == 1
    assert len(robot.findall("link")) == 16 + 2 * 14  # two of little mass between the hinges of each joint


def test_both_figures_are_in_one_recording(run: Path, files: list[dict[str, object]], walk: Motion) -> None:
    """Simulated and reference, frame by frame, as the trajectory has them; marked as simulated."""
    trajectory = Trajectory.load(run / "trajectory.npz", read_motion_json(run / "motion.json"))
    glb = of(files, "both", "glb").read_bytes()
    scene = json.loads(glb[20 : 20 + int.from_bytes(glb[12:16], "little")])
    assert [scene["nodes"][k]["name"] for k in scene["scenes"][0]["nodes"]] == ["simulated", "reference"]
    record = next(r for r in files if (r["what"], r["format"]) == ("both", "glb"))
    assert (record["frames"], record["rate"]) == (FRAMES + 1, 30.0)  # and the start
    assert scene["asset"]["extras"]["provenance"]["simulated"] is True
    pair = pair_of_run(run)
    for figure, root, rotations in zip(
        pair.figures,
        (trajectory.root, trajectory.reference_root),
        (trajectory.rotations, trajectory.reference_rotations),
        strict=True,
    ):
        np.testing.assert_array_equal(figure.motion.root[1:], root[0])
        np.testing.assert_allclose(angle_between(figure.motion.rotations[1:], rotations[0]), 0.0, atol=1e-7)
        np.testing.assert_allclose(figure.motion.root[0], walk.root[0], atol=1e-9)
    for form in ("mcap", "glb"):
        note = json.loads(note_path(of(files, "both", form)).read_text())
        assert note["simulated"] is True and len(note["inputs"]["trajectory"]) == 64


def table_of(path: Path) -> dict[str, Array]:
    """The columns of a CSV, of a MOT or, times alone, of a TRC."""
    lines = path.read_text().splitlines()
    if path.suffix == ".trc":
        return {"time": np.array([float(line.split("\t")[1]) for line in lines[5:] if line.strip()])}
    split = "," if path.suffix == ".csv" else "\t"
    if path.suffix == ".mot":
        lines = lines[lines.index("endheader") + 1 :]
    rows = np.array([[float(cell or "nan") for cell in line.split(split)] for line in lines[1:]])
    return dict(zip(lines[0].split(split), rows.T, strict=True))


def test_simulated_and_reference_differ_at_equal_times_as_the_scores_say(
    run: Path, files: list[dict[str, object]], walk: Motion
) -> None:
    trajectory = Trajectory.load(run / "trajectory.npz", read_motion_json(run / "motion.json"))
    fit = joint_fits(joint_angles(trajectory.reference_rotations[0]), joint_angles(trajectory.rotations[0]))
    moved, wanted = (table_of(of(files, what, "csv")) for what in ("simulated", "reference"))
    times = moved["time_s"]
    np.testing.assert_allclose(times, np.arange(FRAMES + 1) / 30.0, atol=1e-6)
    for side in ("left", "right"):
        knee = wanted[f"knee_{side}_deg"]
        # One cycle; the file of the reference ends a frame before it begins again.
        at = np.interp(times, wanted["time_s"], knee, period=walk.duration)
        apart = moved[f"knee_{side}_deg"] - at
        assert abs(apart[0]) < 1e-3  # the start is the reference's pose
        rms = float(np.sqrt(np.mean(apart[1:] ** 2)))
        assert rms == pytest.approx(getattr(fit["knee"], side).rmse_deg, abs=0.1)


@pytest.mark.parametrize("what", list(SOURCES))
def test_all_files_of_a_motion_have_one_clock(files: list[dict[str, object]], what: str) -> None:
    """The first frame is at 0; the sidecar file says when that was."""
    clocks = [table_of(of(files, what, form)) for form in ("csv", "mot", "trc")]
    starts = [next(iter(columns.values()))[0] for columns in clocks]
    assert starts == [0.0, 0.0, 0.0]
    note = json.loads(note_path(of(files, what, "csv")).read_text())
    assert note["starts_at_s"] == (captured().times[30] if what == "capture" else 0.0)


def test_a_capture_has_one_pelvis(tmp_path: Path) -> None:
    """A recorded one that leans further than hips and spine show: the hips of CSV and MOT follow it."""
    clip, pelvis = captured(), NODES.index("hip_center")
    assert clip.rotations is not None
    turned = clip.rotations.copy()
    lean = from_axis_angle("Y", np.full(len(turned), 0.1))
    turned[:, pelvis] = multiply(turned[:, pelvis], lean)
    for node in ("spine", "hip_left", "hip_right"):
        turned[:, NODES.index(node)] = multiply(conjugate(lean), turned[:, NODES.index(node)])
    even = replace(clip, rotations=turned, times=np.arange(FRAMES) / 30.0)
    write_converted(tmp_path, even)
    source = sources_of_run(tmp_path)["capture"]
    measured, shown = coordinates(source.on_nodes), leg_angles(clip.positions)
    for side in ("left", "right"):
        flexion = measured[f"hip_flexion_{side[0]}"]
        np.testing.assert_allclose(np.degrees(source.angles[f"hip_{side}"]), flexion, atol=1e-6)
        leaning = np.degrees(shown[f"hip_{side}"][30:] + 0.1)
        np.testing.assert_allclose(flexion, leaning, atol=1.0)


def test_the_knees_of_the_simulated_body_are_its_own(run: Path, tmp_path: Path) -> None:
    """A swing out of hyperextension, too fast for a noisy sensor, of a knee that gives way to the side."""
    source = sources_of_run(run, ["simulated"])["simulated"]
    motion, knee = source.motion, NODES.index("knee_left")
    degrees = np.tile([-1.0, -5.7, -10.6, -8.6, -4.0, 12.7, 36.0, 60.0, 30.0, 5.0], 9)
    turns = motion.rotations[: len(degrees)].copy()
    turns[:, knee] = from_rotvec(np.radians(np.stack([np.full(90, 5.0), degrees, np.zeros(90)], axis=-1)))
    motion = replace(
        motion, rotations=turns, root=motion.root[: len(degrees)], contacts=motion.contacts[: len(degrees)]
    )
    write_mcap(tmp_path / "swing.mcap", motion)
    swing = {"simulated": source_of_mcap(tmp_path / "swing.mcap", recover=False)}
    bvh, trc, table = (one.path for one in export(swing, ["mot", "bvh", "trc"], tmp_path, "swing"))
    np.testing.assert_allclose(-table_of(table)["knee_angle_l"], degrees, atol=1e-4)
    back = read(bvh)
    found = leg_angles(to_nodes(back)[0], times=back.times, knees=recorded_knees(back))
    np.testing.assert_allclose(np.degrees(found["knee_left"]), degrees, atol=0.1)
    # Points show no hinge: the bend to the side counts, too, but the sign is right.
    back = read(trc)
    seen = np.degrees(leg_angles(to_nodes(back)[0], times=back.times)["knee_left"])
    far = np.abs(degrees) > 5.0
    assert (np.sign(seen[far]) == np.sign(degrees[far])).all()
