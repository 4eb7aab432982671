"""Joints without a known name, told by the tree and the motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples import bvh, source_of
from samples.motion import rigid_walk

from kinemimic.pipeline.kinematics.joints_by_tree import joints_by_tree, named_by_tree
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODE_PARENTS, NODES
from kinemimic.pipeline.readers import recognise

SHOWN = rigid_walk(60, 60.0)
LIMBS = [node for node in NODES if node.endswith(("left", "right"))]
NUMBERED = tuple(f"joint_{k}" for k in range(len(NODES)))


@pytest.mark.parametrize("turn", [("X", 0.0), ("X", 1.6), ("Y", 3.1)])
def test_limbs_in_any_axes_and_unit(turn: tuple[str, float]) -> None:
    found = joints_by_tree(NODE_PARENTS, 39.4 * rotate(from_axis_angle(*turn), SHOWN.joints))
    assert found is not None
    assert {node: found[node] for node in LIMBS} == {node: NODE_INDEX[node] for node in LIMBS}
    assert (found["spine"], found["shoulder_center"], found["head"]) == (1, 2, 3)


def test_joints_for_twist_are_no_knees() -> None:
    knee, ankle = (NODE_INDEX[f"{joint}_left"] for joint in ("knee", "ankle"))
    middle = 0.5 * (SHOWN.joints[:, knee] + SHOWN.joints[:, ankle])
    points = np.insert(SHOWN.joints, ankle, middle, axis=1)
    parents = [parent + (parent >= ankle) for parent in NODE_PARENTS]
    parents.insert(ankle, knee)
    parents[ankle + 1] = ankle
    found = joints_by_tree(tuple(parents), points)
    assert found is not None
    assert (found["knee_left"], found["ankle_left"]) == (knee, ankle + 1)


def test_legs_and_trunk_that_hang_from_a_waist_below_the_origin() -> None:
    """As in MikuMikuDance: the origin, which stays, is no spine."""
    waist = SHOWN.joints[:, :1] + [0.0, 0.0, 0.05]
    points = np.concatenate([np.zeros_like(waist), waist, SHOWN.joints], axis=1)
    parents = (-1, 0, *(parent + 2 for parent in NODE_PARENTS))
    spine = NODES.index("spine") + 2
    parents = tuple(1 if joint == spine else parent for joint, parent in enumerate(parents))
    found = joints_by_tree(parents, points)
    assert found is not None
    assert (found["spine"], found["knee_left"]) == (spine, NODES.index("knee_left") + 2)


def test_what_is_not_clearly_a_person_is_not_named() -> None:
    long_arms = SHOWN.joints.copy()
    arms = [NODE_INDEX[f"{joint}_{s}"] for joint in ("elbow", "wrist", "hand") for s in ("left", "right")]
    for joint in arms:
        shoulder = NODE_INDEX["shoulder_left" if NODES[joint].endswith("left") else "shoulder_right"]
        long_arms[:, joint] = long_arms[:, shoulder] + 2.0 * (long_arms[:, joint] - long_arms[:, shoulder])
    for points in (long_arms, np.full_like(long_arms, np.nan), np.zeros_like(long_arms)):
        assert joints_by_tree(NODE_PARENTS, points) is None
        assert named_by_tree(NUMBERED, NODE_PARENTS, points) == (NUMBERED, None)
    # A chain, and a body without feet, of which left and right are unknown.
    assert joints_by_tree(tuple(range(-1, 19)), SHOWN.joints) is None
    feet = {NODE_INDEX["foot_left"], NODE_INDEX["foot_right"]}
    kept = [joint for joint in range(len(NODES)) if joint not in feet]
    parents = tuple(kept.index(NODE_PARENTS[k]) if NODE_PARENTS[k] >= 0 else -1 for k in kept)
    assert joints_by_tree(parents, SHOWN.joints[:, kept]) is None


def test_known_names_stay() -> None:
    assert named_by_tree(NODES, NODE_PARENTS, SHOWN.joints) == (NODES, None)


def test_a_bvh_with_numbered_joints_is_the_same_motion() -> None:
    named = bvh.files(60)["walk.bvh"].decode()
    text = named
    for number, node in enumerate(NODES):
        text = text.replace(f" {node}\n", f" joint_{number}\n")
    same, clip = (recognise.read_source(source_of(one, Path("walk.bvh"))) for one in (named, text))
    assert np.array_equal(clip.positions, same.positions)
    assert {"knee_left", "ankle_right"} <= set(clip.skeleton.names)
    (note,) = clip.provenance["reading"]["notes"]
    assert "joints told by their places in the skeleton: hip_left = joint_12" in note
