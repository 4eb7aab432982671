"""Gimbal lock: its distance for every order, flags at and near it, and flips without a turn of the body."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console
from scipy.spatial.transform import Rotation

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.euler import rotations_of_channels
from kinemimic.pipeline.kinematics.gimbal import distance_from_lock, flips, gimbal_report, table
from kinemimic.pipeline.kinematics.rotations import (
    IDENTITY,
    ORDERS,
    angle_between,
    conjugate,
    from_axis_angle,
    from_euler,
    multiply,
    to_rotvec,
)

Build = Callable[..., Clip]


@pytest.mark.parametrize("order", ORDERS)
def test_lock_is_where_the_channels_lose_a_degree_of_freedom(order: str) -> None:
    """By the definition: the axes of the three channels are coplanar exactly at lock."""
    for middle in np.radians(np.arange(-720, 721, 15)):
        axes = []
        for k in range(3):
            step = np.zeros(3)
            step[k] = 1e-6
            angles = np.array([0.4, middle, -1.1])
            plus, minus = from_euler(angles + step, order), from_euler(angles - step, order)
            axes.append(to_rotvec(multiply(plus, conjugate(minus))) / 2e-6)
        volume = abs(np.linalg.det(np.array(axes)))
        assert np.sin(distance_from_lock(middle, order)) == pytest.approx(volume, abs=1e-6)


def with_channels(node_clip: Build, euler: Array, order: str) -> tuple[Clip, Array]:
    """Channels (T, 3) on the left elbow, all else still."""
    clip = node_clip(len(euler))
    channels = np.zeros((len(euler), 20, 3))
    channels[:, 5] = euler
    orders = ("",) * 5 + (order,) + ("",) * 14
    clip = replace(clip, euler=channels, orders=orders, translations=np.zeros_like(channels))
    return clip, rotations_of_channels(channels, orders, IDENTITY)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("off", [0.0, 1e-9, -1e-9, 1e-12])
def test_frames_at_lock_are_flagged(node_clip: Build, order: str, off: float) -> None:
    lock = 0.0 if order[0] == order[2] else np.pi / 2
    euler = np.zeros((30, 3))
    euler[:, 1] = lock + np.radians(40)
    euler[10:13, 1] = lock + off
    euler[20, 1] = lock - np.radians(4.9)
    euler[21, 1] = lock - np.radians(5.1)
    report = gimbal_report(*with_channels(node_clip, euler, order))
    (joint,) = report["joints"]
    assert joint["joint"] == "elbow_left"
    assert joint["flagged_frames"] == [[10, 12], [20, 20]]
    assert joint["nearest_deg"] < 1e-6
    assert joint["order"] == ("YZX (Eq. 8)" if order == "YZX" else order)


def test_a_flip_is_distinguished_from_a_fast_turn() -> None:
    t = np.linspace(0, 1, 60)
    euler = np.stack([0.3 * np.sin(5 * t), 1.2 + 0.2 * t, 0.4 * t], axis=-1)
    flipped = euler.copy()
    flipped[30:] = np.stack([euler[30:, 0] + np.pi, np.pi - euler[30:, 1], euler[30:, 2] + np.pi], axis=-1)
    rotations = from_euler(flipped, "ZYX")
    assert angle_between(rotations, from_euler(euler, "ZYX")).max() < 1e-7  # the same motion
    assert flips(flipped, rotations).tolist() == [30]
    assert flips(euler, from_euler(euler, "ZYX")).tolist() == []
    turning = np.zeros((10, 3))
    turning[5:, 0] = np.radians(100)  # the body itself turns by as much
    assert flips(turning, from_euler(turning, "ZYX")).tolist() == []
    wrapped = np.zeros((10, 3))
    wrapped[:, 0] = np.radians(np.where(np.arange(10) < 5, 179.0, -179.0))  # 358 degrees are 2
    assert flips(wrapped, from_euler(wrapped, "ZYX")).tolist() == []


def test_a_passage_through_lock_is_reported_and_its_rotation_is_smooth(node_clip: Build) -> None:
    """A turn about one fixed axis, whose Euler angles must jump where the middle angle passes 90 degrees."""
    tilt = Rotation.from_euler("X", 0.004)
    motion = tilt * Rotation.from_euler("Z", np.linspace(np.radians(60), np.radians(120), 41)[:, None])
    euler = motion.as_euler("YZX")
    clip, rotations = with_channels(node_clip, euler, "YZX")
    (joint,) = gimbal_report(clip, rotations)["joints"]
    (first, last), *others = joint["flagged_frames"]
    assert others == []
    assert first < 20 < last
    assert joint["flips"] and all(first <= frame <= last + 1 for frame in joint["flips"])
    steps = angle_between(rotations[:-1, 5], rotations[1:, 5])
    assert steps == pytest.approx(np.radians(1.5), abs=1e-6)
    assert (np.sum(rotations[1:] * rotations[:-1], axis=-1) >= 0).all()


def test_the_table_names_joint_order_and_frames(node_clip: Build) -> None:
    euler = np.zeros((30, 3))
    euler[10:13, 1] = np.pi / 2
    console = Console(width=200, record=True, file=None, quiet=False, force_terminal=False)
    with console.capture() as captured:
        console.print(table(gimbal_report(*with_channels(node_clip, euler, "YZX"))))
        console.print(table({"frames": 3, "joints": []}))
    text = captured.get()
    assert all(word in text for word in ("elbow_left", "YZX (Eq. 8)", "10-12", "no Euler channels"))


def test_a_capture_of_positions_has_no_channels(node_clip: Build) -> None:
    assert gimbal_report(node_clip(), None)["joints"] == []


@pytest.mark.parametrize(("turned", "expected"), [(26.0, [1]), (34.0, []), (0.0, [1])])
def test_a_flip_jumps_by_more_than_twice_the_turn(turned: float, expected: list[int]) -> None:
    euler = np.radians([[0.0, 0.0, 0.0], [60.0, 0.0, 0.0]])
    rotations = from_axis_angle("X", np.radians([0.0, turned]))
    assert flips(euler, rotations).tolist() == expected
