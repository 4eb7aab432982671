"""Gait metrics of synthetic walks with known values, and of a virtual Kinect against its truth."""

import re
import shutil
from dataclasses import replace

import numpy as np
import pytest
from samples.motion import rigid_walk

from kinemimic.evaluate.scoring.gait_command import gait
from kinemimic.evaluate.scoring.metrics.gait_report import gait_report
from kinemimic.evaluate.scoring.metrics.gait_subjects import captured, strike_phases
from kinemimic.evaluate.scoring.reports.gait_page import cell, gait_page, notes
from kinemimic.pipeline.convert import convert, read_converted
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.sidecars import read_truth
from kinemimic.pipeline.files.store import read_json
from kinemimic.pipeline.gait.curves import over_cycle
from kinemimic.pipeline.ingest import ingest
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, multiply
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.virtual_kinect.recorder import record_virtual
from kinemimic.pipeline.writers.bvh import write_bvh
from kinemimic.pipeline.writers.poses import Poses
from kinemimic.retarget.command import retarget
from kinemimic.retarget.formats.motion_json import motion_to_json

# As in conftest.py: a period of 1.2 s at 0.41 m/s, knees 0.5 ± 0.4 rad, hips 0.1 ± 0.35 rad.
CADENCE, SPEED, STRIDE, KNEE_RANGE, HIP_RANGE = 100.0, 0.41, 0.492, np.degrees(0.8), np.degrees(0.7)


@pytest.fixture(scope="module")
def report(walk, performance):
    return gait_report(None, walk, performance(offset=np.radians(4.0)))


@pytest.mark.parametrize("who", ["reference", "simulated"])
def test_metrics_of_a_synthetic_walk(report, who):
    subject = report["subjects"][who]
    table, curves = subject["parameters"], subject["curves"]
    assert table["cadence_steps_per_min"]["both"]["mean"] == pytest.approx(CADENCE, rel=0.002)
    assert table["speed_m_s"]["both"]["mean"] == pytest.approx(SPEED, rel=0.005)
    assert table["stride_length_m"]["both"]["mean"] == pytest.approx(STRIDE, rel=0.005)
    assert subject["leg_length_m"] == pytest.approx(0.78)  # of the body of Table 1
    assert subject["normalised"]["speed"] == pytest.approx(SPEED / np.sqrt(9.81 * 0.78), rel=0.005)
    for side in ("left", "right"):
        assert curves[f"knee_{side}"]["range_deg"]["mean"] == pytest.approx(KNEE_RANGE, abs=0.1)
        assert curves[f"hip_{side}"]["range_deg"]["mean"] == pytest.approx(HIP_RANGE, abs=0.1)
        assert max(curves[f"knee_{side}"]["sd"]) < 0.5
        assert subject["off_axis_knee_deg"][side]["peak"] == pytest.approx(0.0, abs=1e-6)
    assert abs(subject["range_symmetry_percent"]["knee"]) < 0.5


def test_only_the_simulation_has_a_stance_by_contact(report):
    # The motion's contacts are of feet that lie flat and still.
    assert report["subjects"]["reference"]["stance_ratio_by_contact"] is None
    assert set(report["subjects"]["simulated"]["stance_ratio_by_contact"]) == {"left", "right"}


def test_simulated_knees_are_offset_by_the_added_flexion(report):
    reference, simulated = (
        np.array(report["subjects"][who]["curves"]["knee_left"]["mean"]) for who in ("reference", "simulated")
    )
    assert np.mean(simulated - reference) == pytest.approx(4.0, abs=0.1)


def test_nothing_after_a_fall_counts(walk, performance):
    # Two seconds of three rollouts: one stride of 1.2 s a side fits, and never three.
    subject = gait_report(None, walk, performance(fall=60))["subjects"]["simulated"]
    assert 0 < subject["strides"]["left"] <= 3
    assert subject["parameters"]["speed_m_s"]["both"]["mean"] == pytest.approx(SPEED, rel=0.01)
    fallen = gait_report(None, walk, performance(fall=5))
    assert fallen["without_a_stride"] == ["simulated"]
    assert notes(fallen) == ["simulated: no full stride, hence no metrics"]
    assert "simulated: no full stride" in gait_page("x", fallen)


def test_off_axis_knee_rotation_is_found_on_its_side_only(walk, performance):
    played = performance()
    rotations, knee = played.rotations.copy(), NODE_INDEX["knee_right"]
    rotations[..., knee, :] = multiply(from_axis_angle("X", np.radians(5.0)), rotations[..., knee, :])
    found = gait_report(None, walk, replace(played, rotations=rotations))["subjects"]["simulated"][
        "off_axis_knee_deg"
    ]
    assert found["right"]["rms"] == pytest.approx(5.0, abs=0.01)
    assert found["right"]["peak"] == pytest.approx(5.0, abs=0.01)
    assert found["left"]["peak"] == pytest.approx(0.0, abs=1e-6)


def test_a_stiff_knee_hides_its_hinge_and_the_other_keeps_its_number(tmp_path):
    """A BVH with rotations, in which one knee never bends."""
    shown = rigid_walk(300, 60.0)
    rotations = shown.rotations.copy()
    rotations[:, NODE_INDEX["knee_right"]] = [0.0, 0.0, 0.0, 1.0]
    write_bvh(tmp_path / "walk.bvh", Poses.rigid(shown.skeleton, 60.0, shown.root, rotations), order="ZXY")
    ingest(tmp_path / "walk.bvh", tmp_path / "run")
    convert(tmp_path / "run")
    subject = captured(tmp_path / "run")
    assert set(subject.off_axis) == {"left"}
    assert any("the right knee hardly bends" in note for note in subject.notes)
    assert not any("positions only" in note for note in subject.notes)


def test_cells():
    assert cell("4 + 5", 1, 1.0) == "4 + 5" and cell(None, 1, 1.0) == "–"
    assert cell(0.61, 1, 100.0) == "61.0"
    assert cell({"mean": 1.234, "sd": 0.056, "n": 3}, 2, 1.0) == "1.23 ± 0.06"
    # A loop's strides differ by rounding only.
    assert cell({"mean": 1.234, "sd": 1e-9, "n": 3}, 2, 1.0) == "1.23"
    assert cell({"mean": 1.234, "sd": None, "n": 1}, 2, 1.0) == "1.23"


def test_the_page_shows_the_subjects_and_cites_its_sources(report):
    page = gait_page("a <walk>", report)
    assert "a &lt;walk&gt;" in page and "Schwartz et al. 2008" in page
    assert "Robinson et al. 1987" in page and "Zeni et al. 2008" in page and "Baker et al. 2009" in page
    assert '<th scope="col">reference</th><th scope="col">simulated</th>' in page
    assert "capture</th>" not in page
    assert page == gait_page("a <walk>", report)


def test_the_page_compares_with_adults_and_children_and_says_how_many_they_are(report):
    page = gait_page("x", report)
    assert '<th scope="col">adults</th><th scope="col">children</th>' in page
    assert "4 adults, 43 strides of CMU" in page and "83 children at their free speed" in page
    (cadence,) = re.findall(r"<td>cadence,[^<]*</td>(.*?)</tr>", page)
    assert re.findall(r"<td>([^<]*)</td>", cadence) == ["100.0", "100.0", "105.1 ± 7.9", "–"]
    # Left and right in one row, so that a reader compares the sides.
    assert "step length, left / right" in page


def test_a_run_is_compared_with_nobody(report):
    subjects = {name: {**one, "kind": "run"} for name, one in report["subjects"].items()}
    page = gait_page("x", {**report, "subjects": subjects})
    assert "adults</th>" not in page and "reference data exist for walking only" in page


def test_the_page_is_titled_by_the_recording_and_says_when_no_camera_was_there(report):
    assert "<h1>Gait of x</h1>" in gait_page("x", report)
    page = gait_page("x", {**report, "recording": "walk.skl", "simulated": True})
    assert "<h1>Gait of walk.skl</h1>" in page and "Simulated capture (virtual Kinect)" in page
    assert "Simulated capture" not in gait_page("x", {**report, "recording": "walk.skl", "simulated": False})


@pytest.fixture(scope="module")
def virtual(tmp_path_factory):
    """A run folder with a virtual Kinect's capture of the stock walk in it."""
    run = tmp_path_factory.mktemp("run")
    ingest(record_virtual(run / "capture", seed=3).skl, run)
    convert(run)
    return run


def test_kinect_metrics_against_the_truth(virtual):
    note = read_json(virtual / "capture" / "kinect_walk.provenance.json")["virtual_kinect"]
    written = gait(virtual)
    assert written["recording"] == "kinect_walk.skl" and written["simulated"]
    subject = written["subjects"]["capture"]
    table = subject["parameters"]
    assert table["cadence_steps_per_min"]["both"]["mean"] == pytest.approx(120 / note["period"], rel=0.03)
    assert table["speed_m_s"]["both"]["mean"] == pytest.approx(note["speed"], rel=0.05)
    assert table["stride_length_m"]["both"]["mean"] == pytest.approx(note["speed"] * note["period"], rel=0.05)
    assert subject["off_axis_knee_deg"] is None
    assert any("virtual Kinect" in text for text in subject["notes"])
    assert any("positions only" in text for text in subject["notes"])


def errors(run, joint):
    """Degrees (strides, 101) by which the capture's curves miss the truth's over the same strides."""
    truth, subject = read_truth(run / "truth.parquet"), captured(run)
    found = []
    for stride in subject.gait.strides:
        name = f"{joint}_{stride.side}"
        seen, true = (
            over_cycle(times[near], curve[near], [stride])
            for times, curve in ((subject.times, subject.angles[name]), (truth["time"], truth[name]))
            for near in [(times > stride.start - 0.2) & (times < stride.end + 0.2)]
        )
        found.append(np.degrees(seen - true)[0])
    errors = np.array(found)
    return errors[np.isfinite(errors).all(axis=1)]


def rms(values):
    return np.sqrt(np.mean(values**2))


def test_kinect_mean_curves_match_the_truth(virtual):
    for joint in ("knee", "hip"):
        missed = errors(virtual, joint)
        assert len(missed) >= 8
        assert rms(missed.mean(axis=0)) < 4.0


def test_hip_angles_are_relative_to_a_reliable_pelvis(virtual, tmp_path):
    """A Kinect's own pelvis throws each stride's hip off; the upright one that `retarget` chose does not."""
    shutil.copytree(virtual, tmp_path / "run")
    before = rms(errors(tmp_path / "run", "hip"))
    retarget(tmp_path / "run")
    assert rms(errors(tmp_path / "run", "hip")) < 0.7 * before
    notes = captured(tmp_path / "run").notes
    assert any("upright" in text for text in notes) and any("no ankle" in text for text in notes)


@pytest.mark.parametrize(
    "text", ["[1]", '{"reliability": 3}', '{"reliability": {"pelvis": false, "trunk_lean_deg": "x"}}', "{"]
)
def test_a_damaged_gait_json_is_named(virtual, tmp_path, text):
    shutil.copytree(virtual, tmp_path / "run", ignore=shutil.ignore_patterns("capture"))
    (tmp_path / "run" / "gait.json").write_text(text)
    with pytest.raises(KinemimicError, match=r"gait\.json[:,].* expected") as caught:
        captured(tmp_path / "run")
    assert "\n" not in str(caught.value)


def test_a_motion_from_another_recording_is_refused(virtual, walk, tmp_path):
    shutil.copytree(virtual, tmp_path / "run", ignore=shutil.ignore_patterns("capture"))
    own = read_converted(virtual).provenance
    place = tmp_path / "run" / "motion.json"
    place.write_text(motion_to_json(replace(walk, provenance={"capture": own})))
    assert list(gait(tmp_path / "run")["subjects"]) == ["capture", "reference"]
    stranger = {**own, "sha256": "0", "source": "a.skl"}
    place.write_text(motion_to_json(replace(walk, provenance={"capture": stranger})))
    with pytest.raises(KinemimicError, match=r"the same recording, found kinect_walk\.skl and a\.skl"):
        gait(tmp_path / "run")


def test_a_foot_strikes_at_the_phase_at_which_its_ankle_is_farthest_ahead(walk):
    positions = walk.kinematics()[0]
    phases = strike_phases(walk)
    for side in ("left", "right"):
        ahead = (positions[:, NODE_INDEX[f"ankle_{side}"]] - positions[:, NODE_INDEX["hip_center"]])[:, 0]
        assert abs((phases[side] - np.argmax(ahead) / len(ahead) + 0.5) % 1.0 - 0.5) < 0.03  # about a frame
    assert (phases["right"] - phases["left"]) % 1.0 == pytest.approx(0.5, abs=0.01)
