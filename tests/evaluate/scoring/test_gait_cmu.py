"""Cadence, stride length and speed of a real walk, computed independently from the text of its files.

CMU 02_01: an optical capture, 120 frames a second, the same take as AMC and as BVH. Nothing of the project
reads them here: the AMC's root lines are cut at blanks, and the BVH's leg is put together from its offsets
and angles with scipy's rotations.
"""

import json
import re

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

from kinemimic.evaluate.scoring.gait_command import command, gait
from kinemimic.pipeline.convert import convert
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.ingest import ingest
from kinemimic.retarget.formats.motion_json import motion_to_json
from kinemimic.retarget.humanoid.motion import Motion

# The ASF says "length 0.45": its numbers are inches times 0.45.
METRE = 0.0254 / 0.45
RATE = 120.0
# Frames, as the AMC numbers them, in which a foot comes down, found by eye in the ankle's distance before the
# root: it grows while the leg swings, stops at these frames, and shrinks while the foot stands and the body
# goes on. (They are also where the ankle's forward speed has fallen from 3.6 m/s to the body's own 1.2; ten
# frames later it rests.) The first left one, before the recording begins, is not to be seen.
STRIKES = {"right": (68, 201, 332), "left": (134, 266)}


def amc_root(text):
    """(T, 3) metres, Y up: the first three numbers of every line that begins with "root"."""
    lines = [line.split() for line in text.splitlines() if line.startswith("root ")]
    return METRE * np.array([[float(word) for word in line[1:4]] for line in lines])


def bvh_ankle(text, side):
    """(T, 3) metres: hips, hip joint, thigh and shank, as the file hangs them together."""
    head, motion = text.split("MOTION")
    joints = re.findall(r"(?:ROOT|JOINT) (\w+)\s*\{\s*OFFSET (\S+) (\S+) (\S+)\s*CHANNELS (\d)", head)
    frames = np.array([line.split() for line in motion.strip().splitlines()[2:]], dtype=float)
    first = np.cumsum([0, *(int(joint[4]) for joint in joints)])
    chain = ["Hips", f"{side[0]}HipJoint", f"{side}UpLeg", f"{side}Leg", f"{side}Foot"]
    place, turn = np.zeros((len(frames), 3)), Rotation.identity(len(frames))
    for name in chain:
        k = [joint[0] for joint in joints].index(name)
        place = place + turn.apply(np.array(joints[k][1:4], dtype=float))
        angles = frames[:, first[k] + int(joints[k][4]) - 3 : first[k + 1]]
        if name == "Hips":
            place = place + frames[:, :3]
        turn = turn * Rotation.from_euler("ZYX", angles, degrees=True)
    return METRE * place


@pytest.fixture(scope="module")
def by_hand(captures):
    root = amc_root((captures / "cmu_asfamc" / "02_01.amc").read_text())
    strides = {}
    for side, frames in STRIKES.items():
        first, last = frames[0], frames[-1]
        count = len(frames) - 1
        seconds = (last - first) / RATE / count
        way = root[last - 1] - root[first - 1]  # frames are counted from 1
        strides[side] = seconds, float(np.hypot(way[0], way[2])) / count
    return strides


def test_the_frames_found_by_eye_are_the_ankles_farthest_ones(captures):
    text = (captures / "cmu_bvh" / "02_01.bvh").read_text()
    root = amc_root((captures / "cmu_asfamc" / "02_01.amc").read_text())
    for side, frames in STRIKES.items():
        # The BVH begins with a T-pose that the AMC does not have; both walk along +Z.
        ahead = bvh_ankle(text, side.capitalize())[1:, 2] - root[:, 2]
        for frame in frames:
            around = np.arange(frame - 1 - 40, min(frame - 1 + 40, len(ahead)))
            assert abs(around[ahead[around].argmax()] - (frame - 1)) <= 1


@pytest.mark.parametrize("file", ["cmu_bvh/02_01.bvh", "cmu_asfamc/02_01.amc"])
def test_report_against_the_numbers_by_hand(captures, tmp_path, by_hand, file):
    ingest(captures / file, tmp_path)
    convert(tmp_path)
    report = gait(tmp_path)["subjects"]
    assert list(report) == ["capture"]
    subject = report["capture"]
    measured = subject["parameters"]
    assert subject["kind"] == "walk" and subject["treadmill_m_s"] is None
    assert subject["strides"] == {"left": 1, "right": 2} and subject["strides_left_out"] == 0
    for side, (seconds, length) in by_hand.items():
        of = {name: row[side]["mean"] for name, row in measured.items()}
        # Half a frame of 1/120 s at either end is 0.8 % of a stride of 1.1 s.
        assert of["stride_time_s"] == pytest.approx(seconds, abs=1.0 / RATE)
        assert of["cadence_steps_per_min"] == pytest.approx(120.0 / seconds, rel=0.01)
        # The root sways back and forth by a centimetre or two between the ankles that the report goes by.
        assert of["stride_length_m"] == pytest.approx(length, abs=0.01)
        assert of["speed_m_s"] == pytest.approx(length / seconds, rel=0.02)
    cadence, length, speed = (
        np.average(
            [what(*stride) for stride in by_hand.values()], weights=[len(f) - 1 for f in STRIKES.values()]
        )
        for what in (lambda t, _: 120.0 / t, lambda _, x: x, lambda t, x: x / t)
    )
    assert measured["cadence_steps_per_min"]["both"]["mean"] == pytest.approx(cadence, rel=0.01)
    assert measured["stride_length_m"]["both"]["mean"] == pytest.approx(length, abs=0.01)
    assert measured["speed_m_s"]["both"]["mean"] == pytest.approx(speed, rel=0.01)


def test_speed_equals_root_displacement_over_the_take(captures, tmp_path):
    """A check that goes by no event at all: the root's way from the first to the last frame."""
    root = amc_root((captures / "cmu_asfamc" / "02_01.amc").read_text())
    way = root[-1] - root[0]
    speed = np.hypot(way[0], way[2]) / ((len(root) - 1) / RATE)
    ingest(captures / "cmu_asfamc" / "02_01.amc", tmp_path)
    convert(tmp_path)
    measured = gait(tmp_path)["subjects"]["capture"]["parameters"]["speed_m_s"]["both"]["mean"]
    assert measured == pytest.approx(speed, rel=0.02)


def test_opensims_walk_on_a_treadmill_against_its_force_plates(captures, tmp_path):
    """OpenSim's gait2354 subject01_walk1.

    Its subject01_walk1_grf.mot says: the left foot comes down on its plate at 0.000 s (20 N), the right one
    leaves the other at 0.167 s. The right heel then strikes and leaves a cycle later.
    """
    ingest(captures / "lab_opensim_gait" / "Gait2354_Simbody__subject01_walk1.trc", tmp_path)
    convert(tmp_path)
    subject = gait(tmp_path)["subjects"]["capture"]
    measured = subject["parameters"]
    stride = measured["stride_time_s"]["both"]["mean"]
    # Both feet are down from 0.000 to 0.167 s; the ankle says when the toes leave 5 % of a stride too early.
    assert measured["double_support_ratio"]["both"]["mean"] / 2 == pytest.approx(0.167 / stride, abs=0.05)
    # The belt carries the planted toe back.
    lines = (captures / "lab_opensim_gait" / "Gait2354_Simbody__subject01_walk1.trc").read_text().splitlines()
    names = lines[3].split("\t")
    column = names.index("R.Toe.Tip")
    rows = np.array([line.split("\t")[: column + 1] for line in lines[6:] if line.strip()], dtype=float)
    flat = (rows[:, 1] > 0.75) & (rows[:, 1] < 1.05)  # the right foot stands alone
    belt = -np.polyfit(rows[flat, 1], rows[flat, column], 1)[0] / 1000.0
    assert subject["treadmill_m_s"] == pytest.approx(belt, rel=0.02)
    # A single stride by the feet alone.
    assert measured["speed_m_s"]["both"]["mean"] == pytest.approx(belt, rel=0.04)


def test_command_line(captures, tmp_path):
    ingest(captures / "cmu_bvh" / "02_01.bvh", tmp_path)
    convert(tmp_path)
    printed = CliRunner().invoke(command, ["--run", str(tmp_path), "--json"])
    assert json.loads(printed.output) == json.loads((tmp_path / "gait_report.json").read_text())
    shown = CliRunner().invoke(command, ["--run", str(tmp_path)])
    assert shown.exit_code == 0
    assert re.search(r"cadence \[steps/min\]\s+109\.\d", shown.output)
    page = (tmp_path / "gait_report.html").read_text()
    assert "Schwartz et al. 2008" in page and "http" not in page.replace("http://www.w3.org", "")


def test_standing_is_refused(tmp_path):
    still = np.tile([0.0, 0.0, 0.0, 1.0], (90, 20, 1))
    standing = Motion(
        30.0, np.tile([0.0, 0.0, 0.9], (90, 1)), still, np.ones((90, 2), dtype=bool), cyclic=False
    )
    (tmp_path / "motion.json").write_text(motion_to_json(standing))
    with pytest.raises(KinemimicError, match="at least one full stride"):
        gait(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["motion.json"]


def test_a_single_cycle_is_refused_with_its_foot_strikes(captures, tmp_path):
    ingest(captures / "lab_opensim_gait/Gait2354_Simbody__subject01_walk1_ik.mot", tmp_path)
    convert(tmp_path)
    with pytest.raises(KinemimicError, match=r"1\.2 s contain 1 left and 1 right foot strikes"):
        gait(tmp_path)


def test_a_missing_or_empty_run_is_refused(tmp_path):
    with pytest.raises(KinemimicError, match="expected a run folder, found none"):
        gait(tmp_path / "none")
    with pytest.raises(KinemimicError, match=r"expected quaternions\.parquet or motion\.json, found neither"):
        gait(tmp_path)
    assert not list(tmp_path.iterdir())
