"""The 20 nodes from the joints that a capture has."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from samples import source_of

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import derived_nodes, joints_of, to_nodes
from kinemimic.pipeline.kinematics.skeleton import BONES, NODE_INDEX, NODES, Skeleton
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.mocap import bvh as reader

Build = Callable[..., Clip]
Text = Callable[..., str]
PATH = Path("walk.bvh")


def test_both_thighs_hang_from_the_pelvis_whatever_its_name(bvh: Text) -> None:
    """Blender's Rigify counts the spine from the pelvis, below a root on the floor."""
    named = to_nodes(reader.read(source_of(bvh(), PATH)))[0]
    rigify = bvh().replace("JOINT Spine ", "JOINT spine.001 ").replace("ROOT Hips", "ROOT spine")
    assert np.array_equal(to_nodes(reader.read(source_of(rigify, PATH)))[0], named)
    floor = "ROOT root { OFFSET 0 0 0 CHANNELS 0 JOINT spine"
    clip = reader.read(
        source_of(rigify.replace("ROOT spine", floor).replace("}\nMOTION", "} }\nMOTION"), PATH)
    )
    assert np.allclose(to_nodes(clip)[0], named, atol=1e-12)


def test_of_an_abdomen_and_a_chest_the_lower_is_the_spine(bvh: Text) -> None:
    named = to_nodes(reader.read(source_of(bvh(), PATH)))[0]
    chest = "JOINT chest { OFFSET 0 20 0 CHANNELS 0 JOINT Neck { OFFSET 0 18 0"
    text = bvh().replace("JOINT Spine ", "JOINT stomach ").replace("JOINT Neck { OFFSET 0 38 0", chest)
    text = text.replace(" 18 34 0", " 18 14 0").replace("-18 34 0", "-18 14 0")
    text = text.replace("} } } }\n  JOINT LeftUpLeg", "} } } } }\n  JOINT LeftUpLeg")
    clip = reader.read(source_of(text, PATH))
    assert np.allclose(to_nodes(clip)[0], named, atol=1e-9)
    assert clip.skeleton.names[joints_of(clip)["spine"]] == "stomach"


def test_the_origin_of_a_scene_is_no_pelvis(node_clip: Build) -> None:
    clip = rename(node_clip(), "hip_center", "Armature")
    clip.positions[:, 0] = 0.0
    assert "hip_center" in derived_nodes(clip)


def test_the_nodes_themselves(node_clip: Build) -> None:
    clip = node_clip()
    positions, states = to_nodes(clip)
    assert np.array_equal(positions, clip.positions)
    assert np.array_equal(states, clip.states)


def test_what_is_derived(bvh: Text) -> None:
    clip = reader.read(source_of(bvh(), PATH))  # no clavicles, no fingers
    positions, states = to_nodes(clip)

    def at(node: str) -> np.ndarray:
        return positions[:, NODE_INDEX[node]]

    assert np.allclose(np.linalg.norm(at("hand_left") - at("wrist_left"), axis=-1), 0.08)
    forearm = at("wrist_left") - at("elbow_left")
    assert np.allclose(np.cross(forearm, at("hand_left") - at("wrist_left")), 0.0, atol=1e-12)
    assert (states[:, NODE_INDEX["hand_left"]] == 1).all()
    assert (states[:, NODE_INDEX["wrist_left"]] == 2).all()
    assert np.allclose(at("head"), clip.positions[:, clip.skeleton.index("Head_end")])


def test_without_a_neck_the_shoulders_give_their_centre(bvh: Text) -> None:
    clip = reader.read(source_of(bvh().replace("JOINT Neck", "JOINT Throat"), PATH))
    positions, states = to_nodes(clip)
    arms = [clip.positions[:, clip.skeleton.index(f"{side}Arm")] for side in ("Left", "Right")]
    assert np.allclose(positions[:, NODE_INDEX["shoulder_center"]], 0.5 * (arms[0] + arms[1]))
    assert (states[:, NODE_INDEX["shoulder_center"]] == 1).all()


def rename(clip: Clip, old: str, new: str) -> Clip:
    names = tuple(new if name == old else name for name in clip.skeleton.names)
    return replace(clip, skeleton=Skeleton(names, clip.skeleton.parents, clip.skeleton.offsets))


LEGS = tuple(f"{joint}_{side}" for side in ("left", "right") for joint in ("hip", "knee", "ankle"))


def only(clip: Clip, kept: tuple[str, ...]) -> Clip:
    """The clip with these joints alone, each of them a root."""
    joints = [clip.skeleton.index(name) for name in kept]
    skeleton = Skeleton(kept, (-1,) * len(kept), np.zeros((len(kept), 3)))
    return replace(
        clip, skeleton=skeleton, positions=clip.positions[:, joints], states=clip.states[:, joints]
    )


def test_legs_and_a_trunk_become_a_whole_body(node_clip: Build) -> None:
    whole = node_clip()
    clip = only(whole, (*LEGS, "hip_center", "spine"))
    positions, states = to_nodes(clip)
    assert set(derived_nodes(clip)) == set(NODES) - {*LEGS, "hip_center", "spine"}
    shown = [NODE_INDEX[node] for node in clip.skeleton.names]
    assert np.array_equal(positions[:, shown], clip.positions)
    assert (states[:, shown] == 2).all()
    assert (np.delete(states, shown, axis=1) == 1).all()

    def at(node: str) -> np.ndarray:
        return np.median(positions[:, NODE_INDEX[node]], axis=0)

    # The figure stands upright and looks along -X: thigh plus shank of 0.80 m make a stature of 1.63 m.
    tall = np.median(
        np.linalg.norm(whole.positions[:, NODE_INDEX["hip_left"]] - at("knee_left"), axis=-1)
        + np.linalg.norm(at("knee_left") - at("ankle_left"))
    ) / (0.245 + 0.246)
    assert tall == pytest.approx(1.63, abs=0.03)
    assert np.linalg.norm(at("elbow_left") - at("shoulder_left")) == pytest.approx(0.186 * tall, rel=0.02)
    assert np.linalg.norm(at("wrist_right") - at("elbow_right")) == pytest.approx(0.146 * tall, rel=0.02)
    assert np.linalg.norm(at("shoulder_center") - at("hip_center")) == pytest.approx(0.288 * tall, rel=0.02)
    assert at("shoulder_left")[1] - at("shoulder_right")[1] == pytest.approx(0.258 * tall, rel=0.02)
    assert at("hand_left")[2] < at("wrist_left")[2] < at("elbow_left")[2] < at("shoulder_left")[2]
    assert at("head")[2] > at("shoulder_center")[2] > at("spine")[2]
    # Left of an upright person is +Y, so that forward is +X.
    assert at("foot_left")[0] - at("ankle_left")[0] == pytest.approx(0.11 * tall, rel=0.02)


def test_what_is_derived_from_a_missing_joint_is_missing(node_clip: Build) -> None:
    clip = only(node_clip(), (*LEGS, "shoulder_left", "shoulder_right"))
    positions, states = clip.positions.copy(), clip.states.copy()
    positions[7, clip.skeleton.index("shoulder_left")] = np.nan
    states[7, clip.skeleton.index("shoulder_left")] = 0
    positions[9, clip.skeleton.index("knee_right")] = np.nan
    states[9, clip.skeleton.index("knee_right")] = 0
    placed, known = to_nodes(replace(clip, positions=positions, states=states))
    missing = {int(frame): set() for frame in np.flatnonzero(np.isnan(placed).any(axis=(1, 2)))}
    for frame in missing:
        missing[frame] = {NODES[k] for k in np.flatnonzero(np.isnan(placed[frame]).any(axis=-1))}
    trunk = {"shoulder_center", "spine", "head", "foot_left", "foot_right"}
    arms = {f"{joint}_{side}" for joint in ("elbow", "wrist", "hand") for side in ("left", "right")}
    assert missing == {7: trunk | arms | {"shoulder_left"}, 9: {"knee_right", "foot_right"}}
    assert np.array_equal(known == 0, np.isnan(placed).any(axis=-1))


def test_an_elbow_between_shoulder_and_wrist(node_clip: Build) -> None:
    clip = node_clip()
    clip = only(clip, tuple(node for node in NODES if node not in ("elbow_left", "hand_left")))
    positions, _ = to_nodes(clip)
    ends = [clip.positions[:, clip.skeleton.index(f"{joint}_left")] for joint in ("shoulder", "wrist")]
    assert np.allclose(positions[:, NODE_INDEX["elbow_left"]], 0.5 * (ends[0] + ends[1]))
    assert derived_nodes(clip) == ("elbow_left", "hand_left")


@pytest.mark.parametrize("node", ["elbow_left", "wrist_right", "spine"])
def test_a_joint_of_an_unknown_name_is_found_by_its_place(node: str, node_clip: Build) -> None:
    clip = node_clip()
    if node == "wrist_right":
        clip = rename(clip, "hand_right", "another")
    positions, _ = to_nodes(rename(clip, node, "thing"))
    expected = clip.positions[:, clip.skeleton.index(node)]
    np.testing.assert_array_equal(positions[:, NODE_INDEX[node]], expected)


def test_a_capture_without_a_trunk_is_refused(node_clip: Build) -> None:
    with pytest.raises(KinemimicError, match="joints of the trunk beside the legs, found none among"):
        to_nodes(only(node_clip(), (*LEGS, "hip_center")))


def test_what_is_missing_is_named(node_clip: Build) -> None:
    with pytest.raises(KinemimicError, match="found none for knee_right among hip_center"):
        to_nodes(rename(node_clip(), "knee_right", "kn"))


def test_lengths_of_no_human_are_refused(node_clip: Build) -> None:
    clip = node_clip()
    with pytest.raises(
        KinemimicError, match=r"hip_left to knee_left between 0\.18 and 0\.65 m, found a median of 4"
    ):
        to_nodes(replace(clip, positions=10.0 * clip.positions))


@pytest.mark.parametrize("folder", ["cmu_bvh", "shum_gait_bvh", "bandai_bvh_ccbync", "kinect2_brekel_bvh"])
def test_real_bodies_have_human_bones(captures: Path, folder: str) -> None:
    for path in sorted((captures / folder).glob("*.bvh")):
        positions, states = to_nodes(reader.read(Source.open(path)))
        assert (states > 0).all()
        for start, end in BONES:
            bone = np.linalg.norm(positions[:, NODE_INDEX[end]] - positions[:, NODE_INDEX[start]], axis=-1)
            assert 0.03 < np.median(bone) < 0.52, (path.name, start, end)
        left, right = positions[:, NODE_INDEX["hip_left"]], positions[:, NODE_INDEX["hip_right"]]
        toes = positions[:, NODE_INDEX["foot_left"]] - positions[:, NODE_INDEX["ankle_left"]]
        # The pelvis' left crossed with up points where the toes do: nothing is mirrored.
        forward = np.cross(left - right, [0.0, 0.0, 1.0])
        assert np.median(np.sum(forward * toes, axis=-1)) > 0
