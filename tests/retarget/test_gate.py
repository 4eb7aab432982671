from __future__ import annotations

from copy import deepcopy
from pathlib import Path

import numpy as np
import pytest

from kinemimic.pipeline.convert import convert
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import read_json, write_json
from kinemimic.pipeline.ingest import ingest
from kinemimic.retarget.command import retarget
from kinemimic.retarget.gate import RULES, check_report, require_trainable
from kinemimic.retarget.humanoid.motion import Motion

STANDING = Motion(
    rate=30.0,
    root=np.zeros((2, 3)),
    rotations=np.tile([0.0, 0.0, 0.0, 1.0], (2, 20, 1)),
    contacts=np.ones((2, 2), dtype=bool),
    cyclic=False,
)
GOOD = {
    "kind": "walk",
    "cyclic": True,
    "warnings": [],
    "cadence_steps_per_min": 105.0,
    "strides_used": 6.8,
    "speed_m_s": 1.2,
    "speed_scaled_m_s": 1.22,
    "range_deg": {
        "knee_left": [1.0, 62.0],
        "knee_right": [0.0, 60.0],
        "hip_left": [-10.0, 30.0],
        "hip_right": [-10.0, 30.0],
    },
    "r2_loop_against_capture": {"knee_left": 0.9, "knee_right": 0.9, "hip_left": 0.95, "hip_right": 0.93},
    "ground": {"slip_m_s": 0.01, "swing_clearance_m": 0.02, "penetration_m": 0.1, "floating_m": 0.1},
    "measures": {"penetration_m": 0.002, "floating_m": 0.003, "beyond_limits_deg": {}},
}


def changed(**values):
    """GOOD with values replaced by path, such as ground__slip_m_s=0.2."""
    report = deepcopy(GOOD)
    for path, value in values.items():
        *above, last = path.split("__")
        place = report
        for key in above:
            place = place[key]
        place[last] = value
    return report


def test_a_good_walk_passes():
    assert check_report(GOOD) == ()


# Of a report: what is changed, and the rule, its severity and a part of its message that follow.
FINDINGS = [
    ({"measures__penetration_m": 0.012}, "penetration", "warn", "ground by 12 mm (limit 10)"),
    ({"measures__penetration_m": 0.03}, "penetration", "refuse", "ground by 30 mm (limit 25)"),
    ({"measures__floating_m": 0.02}, "floating", "warn", "floats by 20 mm (limit 15)"),
    ({"measures__floating_m": 0.05}, "floating", "refuse", "floats by 50 mm (limit 25)"),
    ({"ground__swing_clearance_m": 0.003}, "clearance", "warn", "by 3.0 mm (limit 5)"),
    ({"ground__swing_clearance_m": -0.008}, "clearance", "refuse", "by -8.0 mm (limit -5)"),
    ({"ground__slip_m_s": 0.1}, "slip", "warn", "0.10 m/s (limit 0.05)"),
    ({"ground__slip_m_s": 0.2}, "slip", "refuse", "0.20 m/s (limit 0.15)"),
    # A value that would read like the limit that it exceeds has more digits.
    ({"ground__slip_m_s": 0.0507}, "slip", "warn", "0.051 m/s (limit 0.05)"),
    ({"strides_used": 1.96}, "strides", "warn", "1.96 strides (limit 2)"),
    ({"range_deg__knee_right": [0.0, 40.0]}, "knee", "warn", "flexion of 40° (limit 45°)"),
    ({"range_deg__knee_right": [0.0, 30.0]}, "knee", "refuse", "flexion of 30° (limit 35°)"),
    ({"range_deg__knee_left": [0.0, 130.0]}, "knee", "warn", "flexion of a knee of 130° (limit 85°)"),
    ({"cadence_steps_per_min": 70.0}, "cadence", "warn", "70 steps/min (limit 80)"),
    ({"cadence_steps_per_min": 170.0}, "cadence", "refuse", "170 steps/min (limit 160)"),
    ({"r2_loop_against_capture__hip_left": 0.6}, "fit", "warn", "R² 0.60"),
    ({"r2_loop_against_capture__hip_left": 0.2}, "fit", "refuse", "R² 0.20"),
    ({"strides_used": 1.4}, "strides", "warn", "1.4 strides"),
    ({"speed_m_s": 1.32}, "speed", "warn", "8 % off"),
    ({"speed_m_s": 0.7}, "speed", "refuse", "43 % off"),
    ({"measures__beyond_limits_deg": {"hip_left": 4.0}}, "limits", "warn", "motion by 4°"),
    ({"measures__beyond_limits_deg": {"hip_left": 40.0}}, "limits", "refuse", "motion by 40°"),
]


@pytest.mark.parametrize(("change", "rule", "severity", "says"), FINDINGS)
def test_every_rule_says_its_number_and_limit(change, rule, severity, says):
    (finding,) = check_report(changed(**change))
    assert (finding.rule, finding.severity) == (rule, severity)
    assert says in finding.message


@pytest.mark.parametrize("speed", [0.0, 0.1, -0.1])
def test_on_the_spot_a_share_of_the_speed_means_nothing(speed):
    assert check_report(changed(speed_m_s=speed, speed_scaled_m_s=-0.2 * speed)) == ()


def test_both_knees_bent_far_are_refused():
    both = {"knee_left": [0.0, 118.0], "knee_right": [0.0, 125.0]}
    refused, warned = check_report(changed(range_deg=both | {"hip_left": [-20.0, 20.0]}))
    assert (refused.rule, refused.severity, refused.value) == ("knee", "refuse", 118.0)
    assert (warned.rule, warned.severity, warned.value) == ("knee", "warn", 125.0)


def test_two_strides_are_enough():
    assert check_report(changed(strides_used=2.0)) == ()


def test_every_rule_is_tested():
    assert {rule.name for rule in RULES} == {rule for _, rule, _, _ in FINDINGS}


def test_runs_have_their_own_limits():
    """150 steps a minute, a knee of 100° and almost no clearance are a run, but no walk."""
    run = {
        "cadence_steps_per_min": 150.0, "ground__swing_clearance_m": -0.01,
        "range_deg": {"knee_left": [10.0, 100.0], "knee_right": [10.0, 101.0]},
    }  # fmt: skip
    assert check_report(changed(kind="run", **run)) == ()
    assert {finding.rule for finding in check_report(changed(**run))} == {"cadence", "clearance", "knee"}


def test_a_motion_without_gait_is_judged_by_ground_and_joint_limits_only():
    squat = {"kind": "motion", "range_deg": {"knee_left": [0.0, 120.0], "knee_right": [0.0, 121.0]}}
    assert check_report(squat | {"measures": GOOD["measures"]}) == ()
    sunk = check_report(
        squat | {"measures": {"penetration_m": 0.1, "floating_m": None, "beyond_limits_deg": {}}}
    )
    assert [finding.rule for finding in sunk] == ["penetration"]


def test_refusals_come_first_and_one_line_names_all(tmp_path: Path):
    report = changed(strides_used=1.4, ground__slip_m_s=0.2, r2_loop_against_capture__hip_left=0.2)
    assert [finding.severity for finding in check_report(report)] == ["refuse", "refuse", "warn"]
    write_json(tmp_path / "gait.json", report)
    with pytest.raises(KinemimicError) as caught:
        require_trainable(tmp_path, STANDING)
    text = str(caught.value)
    assert "\n" not in text
    assert "0.20 m/s (limit 0.15)" in text and "R² 0.20" in text and "1.4 strides" not in text
    assert "--anyway" in text
    require_trainable(tmp_path, STANDING, anyway=True)


def test_warnings_and_unknown_motions_pass(tmp_path: Path):
    require_trainable(tmp_path, STANDING)
    write_json(tmp_path / "gait.json", changed(strides_used=1.4))
    require_trainable(tmp_path, STANDING)


@pytest.mark.parametrize(
    "name",
    [
        "kinect1_bernstein_skl/r2.skl",
        "kinect1_bernstein_skl/i1.skl",
        "kinect1_bernstein_skl/micha_walk.skl",
        "cmu_bvh/02_01.bvh",
        "cmu_bvh/09_01.bvh",
    ],
)
def test_real_walks_and_runs(tmp_path: Path, captures: Path, name):
    """Motions that the humanoid was trained on pass."""
    ingest(captures / name, tmp_path)
    convert(tmp_path)
    require_trainable(tmp_path, retarget(tmp_path))


def test_a_walk_in_which_the_tracked_hip_jumps_becomes_no_loop(tmp_path: Path, captures: Path):
    """The ankles of its steps do not alternate: it is kept as recorded, and a loop is refused."""
    ingest(captures / "kinect1_bernstein_skl/tal_l2r.skl", tmp_path)
    convert(tmp_path)
    retarget(tmp_path)
    assert not read_json(tmp_path / "gait.json")["cyclic"]
    with pytest.raises(KinemimicError, match="expected strides for --loop"):
        retarget(tmp_path, loop=True)
