from __future__ import annotations

import numpy as np
import pytest
from samples.bouts import bouts_of

from kinemimic.pipeline.kinematics.rotations import from_axis_angle, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.retarget.strides.loop import pool_strides
from kinemimic.retarget.strides.sensor_reliability import assess_reliability, knees_in_sagittal_plane

ABOVE = ("spine", "shoulder", "head", "elbow", "wrist", "hand")


def strides_of(clip):
    return pool_strides(clip, bouts_of(clip))


def test_all_parts_of_an_exact_recording_are_reliable(walker):
    reliability = assess_reliability(strides_of(walker(heading=1.0).clip))
    assert reliability.precise and reliability.pelvis and reliability.torso and reliability.feet
    assert reliability.measured["leg_bone_spread"] < 1e-9


def test_a_hip_line_that_does_not_repeat_is_unreliable(walker):
    """Constant bones, as in a BVH of a depth sensor, but a pelvis that yaws at random."""
    clip = walker(seconds=4.4).clip
    strides = strides_of(clip)
    p = strides.positions.copy()
    yaw = np.radians(12) * np.random.default_rng(0).standard_normal(len(p))
    for side, sign in (("left", 1), ("right", -1)):
        shift = 0.09 * sign * np.stack([-np.sin(yaw), np.cos(yaw) - 1, 0 * yaw], axis=-1)
        for joint in ("hip", "knee", "ankle", "foot"):
            p[:, N[f"{joint}_{side}"]] += shift
    reliability = assess_reliability(type(strides)(**{**vars(strides), "positions": p}))
    assert reliability.measured["leg_bone_spread"] < 1e-9
    assert not reliability.pelvis and not reliability.precise and not reliability.feet


def test_feet_that_point_down_in_stance_are_unreliable(walker):
    strides = strides_of(walker().clip)
    p = strides.positions.copy()
    for side in ("left", "right"):
        p[:, N[f"foot_{side}"]] -= [0, 0, 0.12]
    assert not assess_reliability(type(strides)(**{**vars(strides), "positions": p})).feet


def test_a_recording_of_legs_alone_is_assessed(walker):
    """Without trunk and arms the lean is unknown and taken as zero."""
    strides = strides_of(walker().clip)
    p = strides.positions.copy()
    p[:, [k for k, node in enumerate(NODES) if node.split("_")[0] in ABOVE]] = np.nan
    reliability = assess_reliability(type(strides)(**{**vars(strides), "positions": p}))
    assert not reliability.torso and not reliability.pelvis
    assert reliability.lean == 0.0
    assert reliability.measured["leg_bone_spread"] < 1e-9


def test_knees_are_moved_into_the_plane_of_hip_ankle_and_heading():
    rng = np.random.default_rng(0)
    p = rng.standard_normal((5, 20, 3)) * 0.05
    p[:, N["ankle_left"]] += [0, 0, -0.8]
    p[:, N["knee_left"]] += [0.1, 0.05, -0.4]
    moved = knees_in_sagittal_plane(p)
    hip, knee, ankle = (moved[:, N[f"{j}_left"]] for j in ("hip", "knee", "ankle"))
    normal = np.cross(ankle - hip, [1.0, 0, 0])
    assert np.sum(normal * (knee - hip), axis=-1) == pytest.approx(np.zeros(5), abs=1e-12)
    assert moved[:, N["hip_left"]] == pytest.approx(p[:, N["hip_left"]])
    heading = np.linspace(-3.0, 3.0, 5)
    turn = from_axis_angle("Z", heading)[:, None]
    assert knees_in_sagittal_plane(rotate(turn, p), heading) == pytest.approx(rotate(turn, moved), abs=1e-12)


def test_a_trunk_that_leans_back_does_not_extend_the_hips_beyond_their_range(walker):
    """As of a sensor that has the hips in front of their place."""
    strides = strides_of(walker(seconds=4.4, noise=0.03).clip)
    p = strides.positions.copy()
    above = [k for k, node in enumerate(NODES) if node.split("_")[0] in ABOVE]
    p[:, above] -= [0.16, 0.0, 0.0]
    reliability = assess_reliability(type(strides)(**{**vars(strides), "positions": p}))
    assert not reliability.pelvis
    assert np.degrees(reliability.lean) < -14.0
    # The thighs reach 17 degrees behind the vertical, and a hip extends by 28.
    assert np.degrees(reliability.pitch) == pytest.approx(-11.0, abs=3.0)


def test_a_neutral_pelvis_of_a_usual_walk_has_the_lean_of_the_trunk(walker):
    reliability = assess_reliability(strides_of(walker(seconds=4.4, noise=0.03).clip))
    assert not reliability.pelvis and reliability.pitch == reliability.lean
