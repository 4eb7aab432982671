"""BVH of a quaternion skeleton: any order, read back to the same joints."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kinemimic.pipeline.kinematics.clip import Clip, forward_kinematics
from kinemimic.pipeline.kinematics.euler import positions_of_channels
from kinemimic.pipeline.kinematics.rotations import Y_UP_TO_Z_UP, from_axis_angle, from_rotvec
from kinemimic.pipeline.kinematics.skeleton import NODES, Skeleton, node_skeleton
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.mocap import bvh
from kinemimic.pipeline.readers.mocap.deepmimic import offsets
from kinemimic.pipeline.writers.bvh import (
    BVH_ORDERS,
    POSITION_CHANNELS,
    file_angles,
    hierarchy_sequence,
    write_bvh,
    write_hierarchy,
)
from kinemimic.pipeline.writers.poses import Poses


@pytest.mark.parametrize("order", BVH_ORDERS)
def test_joint_positions_survive_every_order(tmp_path: Path, order: str) -> None:
    rng = np.random.default_rng(1)
    skeleton = node_skeleton(offsets())
    root, rotations = rng.normal(size=(8, 3)), from_rotvec(rng.normal(size=(8, 20, 3)))
    translations = np.broadcast_to(skeleton.offsets, (8, 20, 3)).copy()
    translations[:, 0] = root
    expected, _ = forward_kinematics(skeleton, translations, rotations)
    path = tmp_path / "a.bvh"
    write_bvh(path, Poses.rigid(skeleton, 40.0, root, rotations), order=order)
    clip = bvh.read(Source.open(path))
    index = [clip.skeleton.index(node) for node in NODES]
    np.testing.assert_allclose(clip.positions[:, index], expected, atol=1e-6)
    np.testing.assert_allclose(clip.times, 0.025 * np.arange(8))


def test_the_root_turns_about_the_files_y_when_one_turns_on_the_spot() -> None:
    turn = from_axis_angle("Z", np.array([0.3]))[:, None]
    np.testing.assert_allclose(file_angles(turn, "YZX"), [[[0.3, 0.0, 0.0]]], atol=1e-12)


def test_joints_are_listed_depth_first() -> None:
    skeleton = Skeleton(("a", "b", "c", "d"), (-1, 0, 0, 1), np.zeros((4, 3)))
    assert hierarchy_sequence(skeleton) == [0, 1, 3, 2]


@pytest.mark.parametrize("order", ["ZXZ", "XXY", ""])
def test_an_order_that_bvh_cannot_name_is_refused(order: str) -> None:
    with pytest.raises(ValueError, match="the six are"):
        file_angles(from_axis_angle("Z", np.zeros((1, 1))), order)


LEGS = ("Hips", "LeftUpLeg", "LeftLeg", "LeftFoot", "RightUpLeg", "RightLeg", "RightFoot")


def made(seed: int, more: int, orders: list[str], moving: list[bool]) -> Clip:
    """Two legs and `more` joints that hang anywhere, each in its order; some slide in their parents."""
    rng = np.random.default_rng(seed)
    joints, frames = len(LEGS) + more, 4
    parents = [-1, 0, 1, 2, 0, 4, 5] + [int(rng.integers(0, 7 + k)) for k in range(more)]
    offsets = np.round(rng.normal(scale=0.3, size=(joints, 3)), 6)
    offsets[[2, 3, 5, 6]] = [0.0, -0.41, 0.0]
    skeleton = Skeleton((*LEGS, *(f"extra {k}" for k in range(more))), tuple(parents), offsets)
    euler = np.radians(rng.uniform(-400.0, 400.0, (frames, joints, 3)))
    translations = np.broadcast_to(offsets, euler.shape).copy()
    slides = [0, *(7 + k for k in range(more) if moving[k])]
    translations[:, slides] += rng.normal(size=(frames, len(slides), 3))
    for joint, order in enumerate(orders):
        euler[:, joint] *= bool(order)

    def placed() -> np.ndarray:
        return positions_of_channels(skeleton, translations, euler, tuple(orders), Y_UP_TO_Z_UP)

    # The reader takes a path for one in another unit if the pelvis would then be a leg above the ground.
    # Between two powers of ten, it never is.
    heights = placed()[..., 2]
    leg = float(np.median((heights[:, :1] - heights[:, [3, 6]]).max(axis=1)))
    translations[:, 0, 1] += np.sqrt(10.0) * leg - np.median(heights[:, 0])
    return Clip(
        skeleton=skeleton,
        times=np.arange(frames) * 0.0125,
        positions=placed(),
        states=np.full((frames, joints), 2, dtype=np.uint8),
        passes=np.zeros(frames, dtype=np.int32),
        euler=euler,
        orders=tuple(orders),
        translations=translations,
        world_from_file=Y_UP_TO_Z_UP,
    )


def write_channels(path: Path, clip: Clip) -> None:
    """Write a clip of Euler channels as it was read: its own joints, orders, angles and offsets."""
    assert clip.euler is not None and clip.orders is not None and clip.translations is not None
    moves = (clip.translations != clip.skeleton.offsets).any(axis=(0, 2))
    moves[0] = True
    channels = [
        (*(POSITION_CHANNELS if moved else ()), *(f"{axis}rotation" for axis in order))
        for moved, order in zip(moves, clip.orders, strict=True)
    ]
    skeleton = replace(clip.skeleton, offsets=100.0 * clip.skeleton.offsets)
    write_hierarchy(
        path, skeleton, channels, 100.0 * clip.translations, np.degrees(clip.euler), 1.0 / clip.rate
    )


def assert_same_channels(before: Clip, after: Clip) -> None:
    """The same joints by name: angles within 1e-4 degrees, places within a hundredth of a millimetre."""
    names = before.skeleton.names
    index = [after.skeleton.index(name) for name in names]
    assert before.euler is not None and after.euler is not None
    assert before.orders is not None and after.orders is not None
    assert [after.orders[k] for k in index] == list(before.orders)
    np.testing.assert_allclose(np.degrees(after.euler[:, index]), np.degrees(before.euler), atol=1e-4)
    np.testing.assert_allclose(after.skeleton.offsets[index], before.skeleton.offsets, atol=1e-5)
    np.testing.assert_allclose(after.positions[:, index], before.positions, atol=1e-5)
    np.testing.assert_allclose(np.diff(after.times), np.median(np.diff(before.times)), atol=1e-6)


@given(data=st.data(), seed=st.integers(0, 2**32 - 1), more=st.integers(0, 6))
@settings(max_examples=60, deadline=None)
def test_any_skeleton_of_any_orders_comes_back(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject, seed: int, more: int
) -> None:
    order = st.sampled_from([*BVH_ORDERS, ""])
    orders = data.draw(st.lists(order, min_size=7 + more, max_size=7 + more).filter(any))
    moving = data.draw(st.lists(st.booleans(), min_size=more, max_size=more))
    clip = made(seed, more, orders, moving)
    path = tmp_path_factory.getbasetemp() / "any.bvh"
    write_channels(path, clip)
    assert_same_channels(clip, bvh.read(Source.open(path)))


def test_real_files_come_back(tmp_path: Path, captures: Path) -> None:
    for folder in ("cmu_bvh", "shum_gait_bvh", "bandai_bvh_ccbync", "kinect2_brekel_bvh"):
        path = min((captures / folder).glob("*.bvh"), key=lambda file: file.stat().st_size)
        clip = bvh.read(Source.open(path))
        write_channels(tmp_path / path.name, clip)
        back = bvh.read(Source.open(tmp_path / path.name))
        assert_same_channels(clip, back)
        assert set(back.skeleton.names) == set(clip.skeleton.names)
