from __future__ import annotations

import numpy as np
import pytest

from kinemimic.pipeline.kinematics.rotations import IDENTITY, angle_between, from_axis_angle, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.retarget.feet.legs import flat_feet, limit_knee_extension, neutral_feet
from kinemimic.retarget.feet.scale import (
    abduct,
    body_kinematics,
    body_width,
    stance_width,
    with_stance_width,
)
from kinemimic.retarget.humanoid.motion import joint_angles


def still(frames: int = 1) -> np.ndarray:
    return np.tile(IDENTITY, (frames, 20, 1))


def test_a_hyperextended_knee_is_straightened_and_the_ankle_stays_in_line():
    q = still()
    q[:, N["hip_left"]] = from_axis_angle("Y", -0.3)
    q[:, N["knee_left"]] = from_axis_angle("Y", np.radians(-18.0))
    out = limit_knee_extension(q)
    assert -0.1 < np.degrees(joint_angles(out)["knee_left"][0]) < 1.0
    before, after = (
        body_kinematics(x)[0][0, N["ankle_left"]] - body_kinematics(x)[0][0, N["hip_left"]] for x in (q, out)
    )
    cosine = before @ after / np.linalg.norm(before) / np.linalg.norm(after)
    assert np.degrees(np.arccos(cosine)) < 0.5
    foot = [body_kinematics(x)[1][:, N["ankle_left"]] for x in (q, out)]
    assert angle_between(*foot).max() < 1e-7


def test_a_flexed_knee_is_unchanged():
    q = still()
    q[:, N["knee_right"]] = from_axis_angle("Y", 0.6)
    assert angle_between(limit_knee_extension(q)[:, N["knee_right"]], q[:, N["knee_right"]]).max() < 1e-4


def test_neutral_feet_are_flat_in_mid_stance():
    phase = np.arange(60) / 60.0
    q = still(60)
    for side, shift in (("left", 0.0), ("right", 0.5)):
        q[:, N[f"hip_{side}"]] = from_axis_angle("Y", -0.4 * np.cos(2 * np.pi * (phase + shift)))
    frames = body_kinematics(neutral_feet(q, phase))[1]
    toes = rotate(frames[:, N["ankle_left"]], np.array([1.0, 0.0, 0.0]))
    pitch = np.degrees(np.arcsin(-toes[:, 2]))
    middle = (phase > 0.15) & (phase < 0.35)
    assert np.abs(pitch[middle]).max() < 4.0
    assert pitch[0] < -5.0  # the heel comes down first


def test_flat_feet_are_level_for_any_leg_pose():
    q = still()
    q[:, N["hip_left"]] = from_axis_angle("Y", -0.9)
    q[:, N["knee_left"]] = from_axis_angle("Y", 0.4)
    frames = body_kinematics(flat_feet(q))[1]
    for ankle in (N["ankle_left"], N["ankle_right"]):
        assert rotate(frames[0, ankle], np.array([0, 0, 1.0])) == pytest.approx([0, 0, 1], abs=1e-9)


def test_abduction_separates_the_ankles_and_keeps_the_feet_level():
    q = still()
    wide = abduct(q, 0.05)
    assert stance_width(body_kinematics(wide)[0]) == pytest.approx(0.17 + 2 * 0.78 * np.sin(0.05))
    assert angle_between(body_kinematics(wide)[1][:, N["ankle_left"]], IDENTITY).max() < 1e-7


@pytest.mark.parametrize("width", [0.08, 0.12, 0.4])
def test_stance_width_is_reached(width):
    q, _ = with_stance_width(still(), width)
    assert stance_width(body_kinematics(q)[0]) == pytest.approx(width, abs=1e-6)


@pytest.mark.parametrize(
    ("asked", "sensed", "precisely"),
    # The soles are 7 cm wide.
    [(0.12, 0.12, 0.12), (0.02, 0.08, 0.08), (0.28, 0.16, 0.28)],
)
def test_a_wide_stance_is_kept_of_a_precise_recording_only(asked, sensed, precisely):
    assert body_width(asked, precise=False) == sensed
    assert body_width(asked, precise=True) == precisely
