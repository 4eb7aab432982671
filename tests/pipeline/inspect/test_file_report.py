"""`inspect` measures the known values of a known walk."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples.motion import walk

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.convert import convert, on_nodes, read_converted
from kinemimic.pipeline.ingest import ingest
from kinemimic.pipeline.inspect.file_report import file_report, inspect_file, unread_report
from kinemimic.pipeline.inspect.measures import (
    available_nodes,
    jitter,
    leg_angle_ranges,
    recorded_angles,
    segment_lengths,
    stature,
)
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import shows_feet
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, rotate
from kinemimic.pipeline.kinematics.skeleton import INFERRED, NODE_INDEX
from kinemimic.pipeline.locomotion.bouts import find_bouts
from kinemimic.pipeline.locomotion.segments import find_segments
from kinemimic.pipeline.locomotion.summary import gait_summary
from kinemimic.pipeline.quality.check import check_capture
from kinemimic.pipeline.readers.mocap.deepmimic import read_deepmimic, stock_motion
from kinemimic.pipeline.readers.recognise import formats
from kinemimic.pipeline.readers.recognise import read as read_capture
from kinemimic.pipeline.virtual_kinect.recorder import record_virtual
from kinemimic.pipeline.virtual_kinect.subject import close_loop

Writer = Callable[..., Path]


@pytest.fixture
def walk_clip(walking: Writer) -> Clip:
    return check_capture(read_capture(walking())).clip


def test_the_report_on_a_known_walk(walking: Writer) -> None:
    report = file_report(walking())
    truth = walk(150)
    assert (report["status"], report["format"]) == ("usable", "Kinect v1 .skl text")
    assert report["sensor"] == "Kinect v1"
    assert report["rate_hz"] == pytest.approx(30.0, rel=0.03)
    assert (report["frames"], report["frames_in_passes"], len(report["passes"])) == (150, 150, 1)
    thigh = np.linalg.norm(truth.joints[0, NODE_INDEX["hip_left"]] - truth.joints[0, NODE_INDEX["knee_left"]])
    assert report["bones_m"]["thigh"]["left"] == pytest.approx(thigh, abs=1e-3)
    assert report["bones_m"]["thigh"]["cv"] < 1e-3
    for side in ("left", "right"):
        peak = np.degrees(np.percentile(truth.angles[f"knee_{side}"], 95.0))
        assert report["angles"]["knee"][side]["high_deg"] == pytest.approx(peak, abs=0.5)
    assert report["joints"]["knee_left"]["tracked"] == 1.0
    assert report["joints"]["knee_left"]["missing"] == 0.0
    assert report["planned_steps"]


def test_segments_are_those_that_retarget_finds(tmp_path: Path) -> None:
    # Before the cleaning, the noise of this recording divides it into other segments.
    capture, run = record_virtual(tmp_path / "capture", seed=0).skl, tmp_path / "run"
    ingest(capture, run)
    convert(run)
    clip = on_nodes(read_converted(run))
    bouts = find_bouts(clip.times, clip.passes, clip.positions, toes=shows_feet(clip.states))
    found = find_segments(clip, clip.positions, bouts)
    assert [(one["name"], one["start_s"], one["end_s"]) for one in file_report(capture)["segments"]] == [
        (one.name, pytest.approx(one.start, abs=1e-3), pytest.approx(one.end, abs=1e-3)) for one in found
    ]


def test_a_report_is_json_with_the_same_keys_whatever_the_file(walking: Writer, tmp_path: Path) -> None:
    good = file_report(walking())
    (tmp_path / "cut.skl").write_text(walking().read_text()[:9000])
    damaged, missing = file_report(tmp_path / "cut.skl"), file_report(tmp_path / "none")
    assert damaged["status"] == missing["status"] == "refused"
    assert list(good) == list(damaged) == list(missing) == list(unread_report(tmp_path, "refused", ""))
    json.dumps([good, damaged, missing], allow_nan=False)


def test_reasons_do_not_repeat_the_path(walking: Writer, tmp_path: Path) -> None:
    (tmp_path / "cut.skl").write_text(walking().read_text()[:9000])
    assert str(tmp_path) not in file_report(tmp_path / "cut.skl")["reason"]


@pytest.mark.parametrize(
    ("content", "status"),
    [
        (b"This data set was recorded by us.\nPlease cite the paper.\n", "other"),
        (b"\x00\x01\x02" * 500, "other"),
        (b"1.5 2.5 3.5\n" * 40, "refused"),  # a table of numbers: someone's capture, but whose
        (b"", "refused"),
    ],
)
def test_prose_is_no_capture_and_a_table_is_one(tmp_path: Path, content: bytes, status: str) -> None:
    (tmp_path / "file").write_bytes(content)
    assert file_report(tmp_path / "file")["status"] == status


def test_sidecar_files_mark_a_capture_as_simulated(walking: Writer) -> None:
    path = walking()
    assert not file_report(path)["simulated"]
    path.with_suffix(".provenance.json").write_text('{"simulated": true}')
    report = file_report(path)
    assert report["simulated"]
    assert report["sidecar_files"] == ["walk.provenance.json"]


def test_too_large_for_the_memory_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def read(path: Path, *, unit: str | None, rate: float | None) -> Clip:
        raise MemoryError

    monkeypatch.setattr("kinemimic.pipeline.inspect.file_report.read", read)
    assert "memory" in inspect_file(tmp_path / "huge").report["reason"]


def test_every_sensor_that_formats_names_is_found(walking: Writer) -> None:
    assert file_report(walking())["sensor"] in {format.sensor for format in formats()}


def detect_gait(clip: Clip, nodes: Array) -> dict[str, Any] | None:
    return gait_summary(find_bouts(clip.times, clip.passes, nodes))


def test_gait_on_a_path_a_treadmill_and_before_a_turning_camera(walk_clip: Clip) -> None:
    nodes, _, _ = available_nodes(walk_clip)
    on_path = detect_gait(walk_clip, nodes)
    middle = nodes[:, [NODE_INDEX["hip_left"], NODE_INDEX["hip_right"]], :2].mean(axis=1)
    in_place = nodes.copy()
    in_place[..., :2] -= middle[:, None]
    treadmill = detect_gait(walk_clip, in_place)
    turn = from_axis_angle("Z", 0.4 * walk_clip.times)
    turning = detect_gait(walk_clip, rotate(turn[:, None], in_place))
    assert on_path is not None
    made = close_loop(read_deepmimic(stock_motion("walk"))).speed
    assert on_path["speed_m_s"] == pytest.approx(made, rel=0.02)
    # Both legs of one stride: the ankles' harmonic has the period of the knee.
    knee = walk(300).angles["knee_left"]
    shifted = [np.corrcoef(knee[:-lag], knee[lag:])[0, 1] for lag in range(25, 60)]
    assert on_path["period_s"] == pytest.approx((25 + int(np.argmax(shifted))) / 30.0, abs=0.02)
    assert on_path["path"] == "recorded"
    for still in (treadmill, turning):
        assert still is not None
        # The path over the ground comes from the feet, to 5 %.
        assert still["path"] == "feet"
        assert still["speed_m_s"] == pytest.approx(made, rel=0.05)
        assert still["period_s"] == pytest.approx(on_path["period_s"], abs=0.02)


def test_standing_and_swapped_legs_are_no_gait(walk_clip: Clip) -> None:
    nodes, _, _ = available_nodes(walk_clip)
    standing = np.repeat(nodes[:1], len(nodes), axis=0)
    standing += np.random.default_rng(0).normal(scale=0.01, size=standing.shape)
    assert detect_gait(walk_clip, standing) is None
    # The left ankle is always the one in front: twice the frequency, which no human has.
    left, right = NODE_INDEX["ankle_left"], NODE_INDEX["ankle_right"]
    behind = nodes[:, left, 0] < nodes[:, right, 0]
    nodes[behind, left], nodes[behind, right] = nodes[behind, right].copy(), nodes[behind, left].copy()
    assert detect_gait(walk_clip, nodes) is None


def test_the_peak_is_of_the_better_tracked_side(walk_clip: Clip) -> None:
    nodes, states, _ = available_nodes(walk_clip)
    worse = states.copy()
    worse[:, NODE_INDEX["ankle_left"]] = INFERRED
    assert leg_angle_ranges(nodes, worse)["knee_peak_side"] == "right"
    noisy = nodes.copy()
    noisy[:, NODE_INDEX["knee_right"]] += np.random.default_rng(0).normal(scale=0.02, size=(len(nodes), 3))
    assert leg_angle_ranges(noisy, states)["knee_peak_side"] == "left"
    gone = np.full_like(nodes, np.nan)
    assert leg_angle_ranges(gone, states)["knee_peak_deg"] is None


def test_stature_of_an_average_body() -> None:
    # Winter's average man of 1.75 m has a thigh of 0.245 and a shank of 0.246 of that.
    lengths = {"thigh": {"median": 0.245 * 1.75}, "shank": {"median": 0.246 * 1.75}}
    assert stature(lengths) == pytest.approx(1.75, abs=1e-3)


def test_bones_of_half_a_body_are_those_that_are_there(walk_clip: Clip) -> None:
    nodes, _, _ = available_nodes(walk_clip)
    nodes[:, NODE_INDEX["ankle_left"]] = np.nan
    lengths = segment_lengths(nodes)
    assert lengths["shank"]["left"] is None
    assert lengths["shank"]["median"] == lengths["shank"]["right"]


def test_jitter_is_the_noise_that_was_added(walk_clip: Clip) -> None:
    noise = np.zeros_like(walk_clip.positions)
    wrist = NODE_INDEX["wrist_left"]
    noise[:, wrist] = np.random.default_rng(1).normal(scale=0.02, size=(len(noise), 3))
    noisy = replace(walk_clip, positions=walk_clip.positions + noise)
    found = jitter(noisy, noisy.passes >= 0)
    assert found[wrist] == pytest.approx(0.02 * np.sqrt(3.0), rel=0.2)
    assert found[NODE_INDEX["hip_center"]] < 0.003


def test_the_files_own_knee_against_ours(walk_clip: Clip) -> None:
    nodes, _, _ = available_nodes(walk_clip)
    truth = walk(150).angles["knee_left"]
    shifted = replace(walk_clip, angles={"knee_left": truth + np.radians(4.0), "elbow_left": truth})
    report = recorded_angles(shifted, nodes, shifted.passes >= 0)
    assert report["knee_left"]["r"] == pytest.approx(1.0, abs=1e-3)
    assert report["knee_left"]["difference_deg"] == pytest.approx(4.0, abs=0.1)
    assert "r" not in report["elbow_left"]


@pytest.mark.parametrize(
    ("name", "peak", "period"),
    [
        # The captures' README: walking 50 to 75 degrees and 0.9 to 1.4 s, running 90 to 125 and 0.7 to 0.8 s.
        ("cmu_bvh/02_01.bvh", (50.0, 75.0), (0.9, 1.4)),
        ("cmu_bvh/09_01.bvh", (90.0, 125.0), (0.70, 0.76)),
        ("kinect1_bernstein_skl/i1.skl", (50.0, 75.0), (0.9, 1.4)),
        ("shum_gait_bvh/SubjectC1_Cycle1.bvh", (50.0, 75.0), (0.9, 1.4)),
    ],
)
def test_real_recordings(
    captures: Path, name: str, peak: tuple[float, float], period: tuple[float, float]
) -> None:
    report = file_report(captures / name)
    assert report["read"]
    assert peak[0] <= report["angles"]["knee_peak_deg"] <= peak[1]
    assert period[0] <= report["gait"]["period_s"] <= period[1]
    assert 0.35 <= report["bones_m"]["thigh"]["median"] <= 0.55
    assert 0.33 <= report["bones_m"]["shank"]["median"] <= 0.45
