"""Rotations and offsets of custom tables: Euler angles, quaternions, either handedness and frame."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from peers.custom_table import FRAMES, UNITY, Array, read, table
from scipy.spatial.transform import Rotation

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.euler import rotations_of_channels, world_positions
from kinemimic.pipeline.kinematics.rotations import angle_between, conjugate, multiply

LIMB = ("pelvis", "thigh", "shank")
OFFSETS = np.array([[0.0, 0.0, 0.0], [0.0, -0.1, 0.09], [0.02, -0.44, 0.0]])


def turning(order: str) -> tuple[Array, Array, Array]:
    """Euler angles in degrees (T, 3, 3), world matrices (T, 3, 3, 3), root (T, 3) of three joints."""
    t = np.linspace(0.0, 1.0, FRAMES)[:, None, None]
    degrees = np.array([[40.0, 25.0, -30.0], [60.0, -35.0, 20.0], [-70.0, 10.0, 15.0]]) * np.sin(
        3.0 * t + 0.4
    )
    local = Rotation.from_euler(order, degrees.reshape(-1, 3), degrees=True).as_matrix().reshape(-1, 3, 3, 3)
    world = local.copy()
    for joint in (1, 2):
        world[:, joint] = world[:, joint - 1] @ local[:, joint]
    root = np.stack([t[:, 0, 0], 0.9 + 0.1 * t[:, 0, 0], 2.0 - t[:, 0, 0]], axis=-1)
    return degrees, world, root


def positions_of(world: Array, root: Array) -> Array:
    places = [root]
    for joint in (1, 2):
        places.append(places[-1] + world[:, joint - 1] @ OFFSETS[joint])
    return np.stack(places, axis=1)


def limb(columns: Sequence[str]) -> str:
    offsets = {name: f"offset = {offset.tolist()}, " for name, offset in zip(LIMB, OFFSETS, strict=True)}
    offsets["pelvis"] = "position = [1, 2, 3], "
    parents = {"pelvis": "", "thigh": "pelvis", "shank": "thigh"}
    lines = [
        f'{name} = {{ {offsets[name]}parent = "{parents[name]}", {column} }}\n'
        for name, column in zip(LIMB, columns, strict=True)
    ]
    return "[joints]\n" + "".join(lines)


@pytest.mark.parametrize("order", ["ZXY", "XYZ", "YXY"])
def test_euler_angles_and_offsets(tmp_path: Path, order: str) -> None:
    degrees, world, root = turning(order)
    rows = np.hstack([root, degrees.reshape(FRAMES, -1)])
    description = f'kinemimic = 1\n[time]\nrate = 30\n[rotations]\norder = "{order}"\n' + limb(
        [f"euler = [{4 + 3 * k}, {5 + 3 * k}, {6 + 3 * k}]" for k in range(3)]
    )
    clip = read(tmp_path, table(rows, decimals=9), description)
    assert clip.orders == (order,) * 3
    assert clip.euler == pytest.approx(np.radians(degrees), abs=1e-9)
    # Y up, Z forward, X left to ours.
    expected = positions_of(world, root)[..., [2, 0, 1]]
    assert clip.positions == pytest.approx(expected, abs=1e-8)
    assert clip.translations is not None and clip.euler is not None
    rotations = rotations_of_channels(clip.euler, clip.orders or (), clip.world_from_file)
    again = world_positions(clip.skeleton, clip.translations, rotations, clip.world_from_file)
    assert again == pytest.approx(clip.positions, abs=1e-9)


@pytest.mark.parametrize("order", ["wxyz", "xyzw"])
@pytest.mark.parametrize("relative", ["parent", "world"])
def test_quaternions_in_either_order_and_frame(tmp_path: Path, order: str, relative: str) -> None:
    _, world, root = turning("ZXY")
    absolute = Rotation.from_matrix(world.reshape(-1, 3, 3)).as_quat().reshape(FRAMES, 3, 4)
    local = absolute.copy()
    for joint in (1, 2):
        local[:, joint] = multiply(conjugate(absolute[:, joint - 1]), absolute[:, joint])
    written = absolute if relative == "world" else local
    written = written[..., [3, 0, 1, 2]] if order == "wxyz" else written
    rows = np.hstack([root, written.reshape(FRAMES, -1)])
    description = (
        f'kinemimic = 1\n[time]\nrate = 30\n[rotations]\norder = "{order}"\nrelative_to = "{relative}"\n'
        + limb([f"quaternion = [{4 + 4 * k}, {5 + 4 * k}, {6 + 4 * k}, {7 + 4 * k}]" for k in range(3)])
    )
    clip = read(tmp_path, table(rows, decimals=9), description)
    assert clip.rotations is not None and clip.euler is None
    assert angle_between(clip.rotations[:, 1:], local[:, 1:]).max() < 1e-7
    assert angle_between(clip.rotations[:, 0], multiply(clip.world_from_file, local[:, 0])).max() < 1e-7
    assert clip.positions == pytest.approx(positions_of(world, root)[..., [2, 0, 1]], abs=1e-7)
    assert (np.sum(clip.rotations[1:] * clip.rotations[:-1], axis=-1) >= 0).all()


def test_left_handed_rotations_give_the_same_motion(tmp_path: Path) -> None:
    """Mirroring x in a right-handed motion M R M gives the numbers that Unity would write."""
    degrees, world, root = turning("ZXY")
    mirror = np.diag([-1.0, 1.0, 1.0])
    left = mirror @ world @ mirror
    local = left.copy()
    for joint in (1, 2):
        local[:, joint] = left[:, joint - 1].swapaxes(1, 2) @ left[:, joint]
    angles = Rotation.from_matrix(local.reshape(-1, 3, 3)).as_euler("ZXY", degrees=True).reshape(FRAMES, 9)
    quats = Rotation.from_matrix(local.reshape(-1, 3, 3)).as_quat().reshape(FRAMES, 12)
    flipped = OFFSETS * [-1.0, 1.0, 1.0]
    for kind, width, values, order in (("euler", 3, angles, "ZXY"), ("quaternion", 4, quats, "xyzw")):
        columns = [f"{kind} = {[4 + width * k + i for i in range(width)]}" for k in range(3)]
        text = limb(columns)
        for offset, other in zip(OFFSETS, flipped, strict=True):
            text = text.replace(f"offset = {offset.tolist()}", f"offset = {other.tolist()}")
        description = (
            f'kinemimic = 1\n[time]\nrate = 30\n[rotations]\norder = "{order}"\n[space]\n{UNITY}{text}'
        )
        rows = np.hstack([root * [-1.0, 1.0, 1.0], values])
        clip = read(tmp_path, table(rows, decimals=9), description)
        assert clip.positions == pytest.approx(positions_of(world, root)[..., [2, 0, 1]], abs=1e-7), kind
        if clip.euler is not None:
            assert clip.euler == pytest.approx(np.radians(degrees), abs=1e-7)


def test_positions_in_the_parents_frame(tmp_path: Path) -> None:
    """UI-PRMD's layout: every joint's place in its parent's frame, in columns, beside Euler angles."""
    degrees, world, root = turning("ZXY")
    places = np.broadcast_to(100.0 * OFFSETS, (FRAMES, 3, 3)).copy()
    places[:, 0] = 100.0 * root
    rows = np.concatenate([places, degrees], axis=-1).reshape(FRAMES, -1)
    description = (
        'kinemimic = 1\n[time]\nrate = 30\n[rotations]\norder = "ZXY"\n[space]\nunit = "cm"\n'
        'relative_to = "parent"\n[columns]\nposition = [1, 2, 3]\neuler = [4, 5, 6]\nstep = 6\n'
        '[joints]\npelvis = { parent = "" }\nthigh = { parent = "pelvis" }\nshank = { parent = "thigh" }\n'
    )
    clip = read(tmp_path, table(rows, decimals=9), description)
    assert clip.positions == pytest.approx(positions_of(world, root)[..., [2, 0, 1]], abs=1e-9)


def test_a_missing_quaternion_is_nan_and_an_invalid_one_is_refused(tmp_path: Path) -> None:
    rows = np.tile([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], (4, 3))
    rows[2, 10:14] = 0.0
    description = (
        "kinemimic = 1\n[time]\nrate = 30\n[columns]\n"
        "position = [1, 2, 3]\nquaternion = [4, 5, 6, 7]\nstep = 7\n"
        '[joints]\na = { parent = "" }\nb = { parent = "a" }\nc = { parent = "b" }\n'
    )
    clip = read(tmp_path, table(rows), description)
    assert clip.rotations is not None
    assert np.isnan(clip.rotations[2, 1]).all() and np.isfinite(clip.rotations[2, 0]).all()
    rows[:, 3:7] *= 37.0
    rows[:, 10:14] *= 37.0
    with pytest.raises(CaptureError, match=r"whose length is 1, found a median length of 37"):
        read(tmp_path, table(rows), description)
