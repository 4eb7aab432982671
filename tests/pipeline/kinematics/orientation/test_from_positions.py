from __future__ import annotations

import numpy as np
import pytest
from samples.mirror import MIRROR

from kinemimic.pipeline.kinematics.clip import forward_kinematics
from kinemimic.pipeline.kinematics.orientation.from_positions import node_rotations
from kinemimic.pipeline.kinematics.rotations import (
    IDENTITY,
    angle_between,
    from_axis_angle,
    from_euler,
    multiply,
    rotate,
    to_rotvec,
)
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import NODES, SIDES, node_skeleton

# Standing upright with hanging arms, facing +X: offsets from the parents of NODE_PARENTS, in NODES' sequence.
OFFSETS = np.array(
    [
        [0, 0, 0], [0, 0, 0.1], [0, 0, 0.4], [0, 0, 0.2],
        [0, 0.2, 0.35], [0, 0, -0.3], [0, 0, -0.25], [0, 0, -0.1],
        [0, -0.2, 0.35], [0, 0, -0.3], [0, 0, -0.25], [0, 0, -0.1],
        [0, 0.09, -0.08], [0, 0, -0.42], [0, 0, -0.4], [0.12, 0, -0.02494],
        [0, -0.09, -0.08], [0, 0, -0.42], [0, 0, -0.4], [0.12, 0, -0.02494],
    ]
)  # fmt: skip


def positions_of(rotations):
    translations = np.broadcast_to(OFFSETS, (len(rotations), 20, 3)).copy()
    return forward_kinematics(node_skeleton(OFFSETS), translations, rotations)[0]


def standing(frames):
    return np.tile(IDENTITY, (frames, len(NODES), 1))


def random_poses(frames, seed=0, least_bend=0.0):
    """Poses that a person can take; knees and elbows are hinges, feet and hands do not turn."""
    rng = np.random.default_rng(seed)
    q = standing(frames)
    q[:, 0] = from_euler(rng.uniform(-1, 1, (frames, 3)) * [3, 0.3, 0.3], "ZYX")
    q[:, N["spine"]] = from_euler(rng.uniform(-0.3, 0.3, (frames, 3)), "ZYX")
    for side in SIDES:
        q[:, N[f"hip_{side}"]] = from_euler(rng.uniform(-1, 1, (frames, 3)) * [0.3, 0.6, 0.3], "ZYX")
        q[:, N[f"knee_{side}"]] = from_axis_angle("Y", rng.uniform(least_bend, 1.5, frames))
        q[:, N[f"shoulder_{side}"]] = from_euler(rng.uniform(-0.6, 0.6, (frames, 3)), "ZYX")
        q[:, N[f"elbow_{side}"]] = from_axis_angle("Y", -rng.uniform(least_bend, 2.0, frames))
    return q


def test_standing_upright_is_the_identity():
    assert angle_between(node_rotations(positions_of(standing(2))), IDENTITY).max() < 1e-3


def test_flexion_has_the_sign_of_the_convention():
    q = standing(1)
    q[0, N["knee_left"]] = from_axis_angle("Y", 1.0)
    q[0, N["elbow_left"]] = from_axis_angle("Y", -1.0)
    p = positions_of(q)[0]
    assert p[N["ankle_left"], 0] < p[N["knee_left"], 0]  # the shank goes backward
    assert p[N["wrist_left"], 0] > p[N["elbow_left"], 0]  # the forearm forward
    found = node_rotations(p[None])[0]
    assert to_rotvec(found[N["knee_left"]]) == pytest.approx([0, 1, 0], abs=1e-6)
    assert to_rotvec(found[N["elbow_left"]]) == pytest.approx([0, -1, 0], abs=1e-6)


def test_knees_and_elbows_are_pure_hinges():
    found = node_rotations(positions_of(random_poses(200)))
    for joint in ("knee", "elbow"):
        for side in SIDES:
            assert np.abs(found[:, N[f"{joint}_{side}"]][:, [0, 2]]).max() < 1e-12


def test_forward_kinematics_gives_the_positions_back():
    p = positions_of(random_poses(300))
    again = positions_of(node_rotations(p))
    upper = [N[f"{joint}_{side}"] for joint in ("knee", "elbow", "hip", "shoulder") for side in SIDES]
    lower = [N[f"{joint}_{side}"] for joint in ("ankle", "wrist") for side in SIDES]
    assert np.abs(again - p)[:, upper].max() < 1e-7
    # Near straight the turn is carried over from the frame before, here of another pose: a few centimetres.
    assert np.linalg.norm(again - p, axis=-1)[:, lower].max() < 0.035
    assert np.linalg.norm(again - p, axis=-1)[:, lower].mean() < 0.003


def test_a_bend_shows_the_twist_of_the_limb_above():
    q = random_poses(200, least_bend=0.6)
    error = np.degrees(angle_between(node_rotations(positions_of(q)), q))
    for name in ("hip_left", "hip_right", "shoulder_left", "shoulder_right"):
        assert error[:, N[name]].max() < 3.0


def test_turning_the_figure_turns_only_the_root():
    p = positions_of(random_poses(20))
    turn = from_euler(np.array([0.9, 0.2, -0.4]), "ZYX")
    plain, turned = node_rotations(p), node_rotations(rotate(turn, p))
    assert angle_between(turned[:, 1:], plain[:, 1:]).max() < 1e-7
    assert angle_between(turned[:, 0], multiply(turn, plain[:, 0])).max() < 1e-7


def test_the_mirror_image_has_mirrored_rotations():
    p = positions_of(random_poses(50))
    image = node_rotations(p[:, MIRROR] * [1, -1, 1])
    assert angle_between(image, node_rotations(p)[:, MIRROR] * [-1, 1, -1, 1]).max() < 1e-7


def test_nothing_flips_where_a_limb_passes_through_straight():
    """The knee goes into hyperextension and the shank sideways: the frames move on by small steps."""
    t = np.linspace(0, 1, 400)
    q = standing(len(t))
    q[:, N["knee_left"]] = multiply(
        from_axis_angle("X", 0.1 * np.sin(14 * t)), from_axis_angle("Y", 0.3 * np.cos(9 * t) - 0.05)
    )
    q[:, N["elbow_right"]] = from_axis_angle("Y", -0.8 * np.cos(7 * t) ** 2)
    found = node_rotations(positions_of(q))
    steps = np.degrees(angle_between(found[1:], found[:-1]))
    assert steps.max() < 5.0
    assert np.sum(found[1:] * found[:-1], axis=-1).min() > 0.99


def test_nothing_flips_while_an_arm_goes_overhead_and_a_leg_kicks():
    t = np.linspace(0, 1, 300)
    q = standing(len(t))
    q[:, N["shoulder_left"]] = from_axis_angle("X", 3.0 * t)  # sideways up to beside the head
    q[:, N["shoulder_right"]] = from_axis_angle("Y", -3.1 * t)  # forward and up
    q[:, N["elbow_left"]] = from_axis_angle("Y", np.full(len(t), -0.4))
    q[:, N["hip_left"]] = from_axis_angle("Y", -1.9 * t)
    found = node_rotations(positions_of(q))
    assert np.degrees(angle_between(found[1:], found[:-1])).max() < 6.0


def test_a_missing_joint_takes_only_what_hangs_on_it():
    p = positions_of(random_poses(3))
    p[1, N["ankle_left"]] = np.nan
    found = node_rotations(p)
    lost = {NODES[k] for k in range(20) if np.isnan(found[1, k]).any()}
    assert lost == {"hip_left", "knee_left", "ankle_left"}
    assert np.isfinite(found[[0, 2]]).all()


def test_coinciding_joints_count_as_missing():
    p = positions_of(standing(1))
    p[0, N["head"]] = p[0, N["shoulder_center"]]
    found = node_rotations(p)
    assert np.isnan(found[0, N["shoulder_center"]]).all()
    assert np.isfinite(found[0, N["spine"]]).all()
