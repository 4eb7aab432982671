"""BVH of a quaternion skeleton: any order, read back to the same joints."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from kinemimic.pipeline.captures import bvh
from kinemimic.pipeline.captures.deepmimic import offsets
from kinemimic.pipeline.captures.source import Source
from kinemimic.pipeline.captures.write_bvh import BVH_ORDERS, file_angles, hierarchy_sequence, write_bvh
from kinemimic.pipeline.clip import forward_kinematics
from kinemimic.pipeline.rotations import from_axis_angle, from_rotvec
from kinemimic.pipeline.skeleton import NODES, Skeleton, node_skeleton


@pytest.mark.parametrize("order", BVH_ORDERS)
def test_joints_come_back_where_they_were_in_every_order(tmp_path: Path, order: str) -> None:
    rng = np.random.default_rng(1)
    skeleton = node_skeleton(offsets())
    root, rotations = rng.normal(size=(8, 3)), from_rotvec(rng.normal(size=(8, 20, 3)))
    translations = np.broadcast_to(skeleton.offsets, (8, 20, 3)).copy()
    translations[:, 0] = root
    expected, _ = forward_kinematics(skeleton, translations, rotations)
    path = tmp_path / "a.bvh"
    write_bvh(path, skeleton, root, rotations, frame_time=0.025, order=order)
    clip = bvh.read(Source.open(path))
    index = [clip.skeleton.index(node) for node in NODES]
    np.testing.assert_allclose(clip.positions[:, index], expected, atol=1e-6)
    np.testing.assert_allclose(clip.times, 0.025 * np.arange(8))


def test_the_root_turns_about_the_files_y_when_one_turns_on_the_spot() -> None:
    turn = from_axis_angle("Z", np.array([0.3]))[:, None]
    np.testing.assert_allclose(file_angles(turn, "YZX"), [[[0.3, 0.0, 0.0]]], atol=1e-12)


def test_joints_stand_depth_first() -> None:
    skeleton = Skeleton(("a", "b", "c", "d"), (-1, 0, 0, 1), np.zeros((4, 3)))
    assert hierarchy_sequence(skeleton) == [0, 1, 3, 2]


@pytest.mark.parametrize("order", ["ZXZ", "XXY", ""])
def test_an_order_that_bvh_cannot_name_is_refused(order: str) -> None:
    with pytest.raises(ValueError, match="the six are"):
        file_angles(from_axis_angle("Z", np.zeros((1, 1))), order)
