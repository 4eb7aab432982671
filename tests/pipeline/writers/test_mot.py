"""OpenSim's motion files: equal knees and hips, the signs of OpenSim's coordinates, a continuous pelvis."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples.motion import rigid_walk

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import (
    from_axis_angle,
    from_rotvec,
    multiply,
)
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES
from kinemimic.pipeline.readers.recognise import read
from kinemimic.pipeline.writers.mot import coordinates, write_mot
from kinemimic.pipeline.writers.poses import Poses

SHOWN = rigid_walk(40, 60.0)
POSES = Poses.rigid(SHOWN.skeleton, 60.0, SHOWN.root, SHOWN.rotations)


def test_mot_comes_back_with_equal_knees_and_hips(tmp_path: Path) -> None:
    write_mot(tmp_path / "walk.mot", POSES)
    back = read(tmp_path / "walk.mot")
    assert back.angles is not None and back.rotations is None
    np.testing.assert_allclose(back.times, np.arange(40) / 60.0, atol=1e-6)
    table = coordinates(POSES)
    for side in ("left", "right"):
        np.testing.assert_allclose(
            np.degrees(back.angles[f"hip_{side}"]), table[f"hip_flexion_{side[0]}"], atol=1e-7
        )
        np.testing.assert_allclose(
            np.degrees(back.angles[f"knee_{side}"]), -table[f"knee_angle_{side[0]}"], atol=1e-7
        )
    # The model's hips have a distance of their own, but their middle is ours.
    middle = SHOWN.joints[:, [NODE_INDEX["hip_left"], NODE_INDEX["hip_right"]]].mean(axis=1)
    np.testing.assert_allclose(back.positions[:, back.skeleton.index("hip_center")], middle, atol=1e-7)
    # Its limbs point where ours point, but for its own bent elbow: upper arm and forearm of the model stand
    # 3.2 and 10 degrees off the line.
    for start, end, off in (
        ("hip", "knee", 0.001),
        ("knee", "ankle", 0.001),
        ("shoulder", "elbow", 3.3),
        ("elbow", "wrist", 11),
    ):
        for side in ("left", "right"):
            ends = (f"{start}_{side}", f"{end}_{side}")
            theirs = bone(back.positions, back.skeleton.names, *ends)
            cosine = np.sum(theirs * bone(SHOWN.joints, NODES, *ends), axis=-1)
            assert np.degrees(np.arccos(np.minimum(cosine, 1.0))).max() < off


def bone(positions: Array, names: tuple[str, ...], start: str, end: str) -> Array:
    """Direction (T, 3) from joint to joint."""
    vector = positions[:, names.index(end)] - positions[:, names.index(start)]
    return np.asarray(vector / np.linalg.norm(vector, axis=-1, keepdims=True))


@pytest.mark.parametrize(
    ("node", "axis", "angle", "coordinate", "expected"),
    [
        ("knee_right", "Y", 0.5, "knee_angle_r", -0.5),
        ("knee_right", "Y", -0.1, "knee_angle_r", 0.1),
        ("knee_right", "Y", -0.5, "knee_angle_r", -0.5),  # no knee bends forward so far
        ("hip_left", "Y", -0.4, "hip_flexion_l", 0.4),
        ("hip_left", "X", 0.3, "hip_adduction_l", -0.3),
        ("hip_right", "X", 0.3, "hip_adduction_r", 0.3),
        ("elbow_left", "Y", -0.7, "elbow_flex_l", 0.7),
        ("shoulder_right", "Y", -0.6, "arm_flex_r", 0.6),
        ("ankle_left", "Y", -0.2, "ankle_angle_l", 0.2),
        ("spine", "Y", 0.2, "lumbar_extension", -0.2),
        ("hip_center", "Z", 0.2, "pelvis_rotation", 0.2),
    ],
)  # fmt: skip
def test_signs_of_opensims_coordinates(
    node: str, axis: str, angle: float, coordinate: str, expected: float
) -> None:
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (2, 20, 1))
    rotations[:, NODE_INDEX[node]] = from_axis_angle(axis, angle)
    found = coordinates(Poses.rigid(SHOWN.skeleton, 30.0, np.zeros((2, 3)), rotations))
    np.testing.assert_allclose(np.radians(found[coordinate]), expected, atol=1e-9)
    others = [name for name in found if name != coordinate and not name.startswith("pelvis_t")]
    np.testing.assert_allclose([found[name] for name in others if name != "pelvis_tilt"], 0.0, atol=1e-9)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_pelvis_that_turns_by_540_degrees_has_a_continuous_pelvis_rotation(way: float) -> None:
    """Also while it leans, so that all three of its angles change."""
    turn = way * np.linspace(0.0, 3.0 * np.pi, 60)
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (60, 20, 1))
    for lean in (0.0, 0.3):
        leant = from_rotvec(np.array([0.5 * lean, lean, 0.0]))
        rotations[:, NODE_INDEX["hip_center"]] = multiply(from_axis_angle("Z", turn), leant)
        found = coordinates(Poses.rigid(SHOWN.skeleton, 30.0, np.zeros((60, 3)), rotations))
        yaw = found["pelvis_rotation"]
        assert yaw[-1] - yaw[0] == pytest.approx(way * 540.0, abs=1e-6)
        assert np.abs(np.diff(yaw)).max() < 20.0
        if not lean:
            np.testing.assert_allclose(yaw, np.degrees(turn), atol=1e-6)
