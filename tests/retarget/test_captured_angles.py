"""The virtual Kinect: errors after cleaning and pooling, against the truth."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest

from kinemimic.pipeline.kinematics.angles import ANGLES
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.orientation.from_positions import local_rotations, node_frames
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, TRACKED, node_skeleton
from kinemimic.retarget.captured_angles import PassSpan, captured_angles
from kinemimic.retarget.command import retarget
from kinemimic.retarget.humanoid.body import node_offsets
from kinemimic.retarget.humanoid.motion import angles_at, joint_angles
from kinemimic.retarget.strides.sensor_reliability import SensorReliability


# People's strides vary and their sides differ, the loop's do not: measured 4.3, 3.4 and 4.5 degrees for the
# worst joint of seeds 3 to 5.
@pytest.mark.parametrize(("variability", "limit"), [(0.0, 4.0), (1.0, 5.0)])
@pytest.mark.parametrize("form", [0, 1], ids=["skl", "euler"])
def test_loop_of_the_virtual_kinect_is_within_four_or_five_degrees_of_the_truth(
    tmp_path, form, variability, limit
):
    from kinemimic.pipeline.convert import convert  # noqa: PLC0415
    from kinemimic.pipeline.ingest import ingest  # noqa: PLC0415
    from kinemimic.pipeline.virtual_kinect.recorder import record_virtual  # noqa: PLC0415 - the stages before

    run = tmp_path / "run"
    ingest(record_virtual(tmp_path, seed=3, variability=variability)[form], run)
    convert(run)
    motion = retarget(run)
    assert json.loads((run / "gait.json").read_text())["simulated_capture"] and motion.simulated
    table = pq.read_table(run / "capture.parquet")
    table = table.filter(table["used"])
    loop = angles_at(motion, table["phase"].to_numpy())
    for name in ANGLES:
        truth, raw = (table[column].to_numpy() for column in (f"truth_{name}", f"adjusted_{name}"))
        before, after = (float(np.degrees(np.sqrt(np.nanmean((x - truth) ** 2)))) for x in (raw, loop[name]))
        assert after < limit and after < 0.6 * before


def test_angles_as_read_are_of_the_measured_pelvis_and_knees_over_all_frames_of_the_pass():
    """A pelvis that the sensor tilts by 12° and knees 6 cm aside: neither may be corrected in the columns as
    read, and frames outside the span must stay, without a phase."""
    frames = 40
    clip = standing(frames, tilt=np.radians(12.0), knee_aside=0.06)
    inside = (clip.times >= 0.5) & (clip.times <= 1.0)
    seconds = clip.times[inside]
    straight = np.tile([0.0, 0.0, 0.0, 1.0], (len(seconds), 1))
    pooled = seconds < 0.8
    span = PassSpan(0, seconds, straight, seconds - 0.4, pooled)
    unreliable = SensorReliability(False, False, False, False, 0.0, (0.0, 0.0), {})
    columns = captured_angles(clip, clip, [span], unreliable, None)
    assert len(columns["time"]) == frames
    np.testing.assert_array_equal(columns["used"], inside & (clip.times < 0.8))
    np.testing.assert_allclose(columns["phase"], np.where(inside, clip.times - 0.4, np.nan))
    measured = joint_angles(local_rotations(node_frames(clip.positions)))
    for name in ANGLES:
        np.testing.assert_allclose(columns[name], measured[name], atol=1e-9)
    apart = np.degrees(columns["hip_left"] - columns["adjusted_hip_left"])
    assert np.abs(apart).min() > 5.0
    assert np.degrees(np.abs(columns["knee_left"] - columns["adjusted_knee_left"])).min() > 0.5


def test_spans_of_one_pass_share_its_frames():
    clip = standing(40, tilt=0.1, knee_aside=0.0)
    spans = []
    for part in (slice(5, 15), slice(20, 35)):
        seconds = clip.times[part]
        spans.append(PassSpan(0, seconds, np.tile([0.0, 0.0, 0.0, 1.0], (len(seconds), 1)), seconds))
    reliability = SensorReliability(True, True, True, True, 0.0, (0.0, 0.0), {})
    columns = captured_angles(clip, clip, spans, reliability, None)
    assert sorted(columns["time"]) == pytest.approx(clip.times)
    assert columns["used"].sum() == np.isfinite(columns["phase"]).sum() == 25


def test_cleaned_angles_are_missing_outside_a_segment():
    """The cleaned clip holds the segment alone, the recording the whole pass."""
    raw = standing(40, tilt=0.1, knee_aside=0.0)
    inside = (raw.times >= 0.3) & (raw.times <= 0.9)
    clip = replace(raw, passes=np.where(inside, 0, -1).astype(np.int32))
    seconds = raw.times[inside]
    span = PassSpan(0, seconds, np.tile([0.0, 0.0, 0.0, 1.0], (len(seconds), 1)), seconds)
    reliability = SensorReliability(True, True, True, True, 0.0, (0.0, 0.0), {})
    columns = captured_angles(clip, raw, [span], reliability, None)
    assert len(columns["time"]) == 40
    for name in ANGLES:
        np.testing.assert_array_equal(np.isfinite(columns[f"clean_{name}"]), inside)
        assert np.isfinite(columns[name]).all()


def standing(frames, *, tilt, knee_aside):
    """A person at the rest pose with a pelvis tilted about Y, and knees moved apart, at 30 Hz."""
    positions = np.repeat(rest_positions()[None], frames, axis=0)
    hips = [NODE_INDEX[name] for name in ("hip_center", "hip_left", "hip_right", "spine")]
    middle = positions[:, hips[1:3]].mean(axis=1, keepdims=True)
    positions[:, hips] = rotate(from_axis_angle("Y", tilt), positions[:, hips] - middle) + middle
    positions[:, NODE_INDEX["knee_left"], 1] += knee_aside
    positions[:, NODE_INDEX["knee_right"], 1] -= knee_aside
    states = np.full(positions.shape[:2], TRACKED, np.uint8)
    passes = np.zeros(frames, np.int32)
    return Clip(node_skeleton(), np.arange(frames) / 30, positions, states, passes)


def rest_positions():
    """(20, 3) of the standard skeleton at rest."""
    skeleton = node_skeleton(node_offsets())
    positions = np.zeros((len(skeleton.names), 3))
    for node, parent in enumerate(skeleton.parents):
        if parent >= 0:
            positions[node] = positions[parent] + skeleton.offsets[node]
    return positions
