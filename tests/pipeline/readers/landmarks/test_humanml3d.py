"""HumanML3D's and KIT-ML's vectors of the known walk, made here by their definition."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest
from samples.joint_array import joints, saved
from samples.motion import walk

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.landmarks.humanml3d import joints_of
from kinemimic.pipeline.readers.landmarks.joint_sets import SETS

NAMES = ("SMPL, 22 joints", "KIT-ML, 21 joints")


def vectors(points: Array, turned: Array) -> Array:
    """(T - 1, 12 J - 1) of joints (T, J, 3), Y up, in axes turned (T,) rad about Y, with noise where they
    repeat themselves."""
    cos, sin = np.cos(turned), np.sin(turned)

    def own(vector: Array, frames: slice) -> Array:
        x, y, z = np.moveaxis(vector, -1, 0)
        c, s = (value[frames].reshape(-1, *[1] * (x.ndim - 1)) for value in (cos, sin))
        return np.stack([c * x + s * z, y, c * z - s * x], axis=-1)

    below = points[:, :1] * [1.0, 0.0, 1.0]
    places = own(points[:, 1:] - below, slice(None)).reshape(len(points), -1)[:-1]
    steps = own(np.diff(points[:, 0], axis=0), slice(1, None))
    rest = np.random.default_rng(0).standard_normal((len(points) - 1, 9 * points.shape[1] - 2))
    half_turns = 0.5 * np.diff(turned)[:, None]
    return np.concatenate([half_turns, steps[:, [0, 2]], points[:-1, :1, 1], places, rest], axis=1)


def known(frames: int, name: str = NAMES[0]) -> tuple[Array, Array]:
    joint_set = next(one for one in SETS if one.name == name)
    points = joints(walk(frames, joint_set.rate), joint_set)
    points -= points[0, 0] * [1.0, 0.0, 1.0]
    return points, 0.4 * np.sin(np.arange(frames) / 9.0)


@pytest.mark.parametrize("name", NAMES)
def test_joints_are_those_of_the_definition(name: str) -> None:
    points, turned = known(60, name)
    np.testing.assert_allclose(joints_of(vectors(points, turned)), points[:-1], atol=1e-12)


@pytest.mark.parametrize(("name", "rate"), [*zip(NAMES, (20.0, 12.5), strict=True)])
def test_a_file_of_vectors_is_a_capture(name: str, rate: float) -> None:
    points, turned = known(80, name)
    content = saved(vectors(points, turned).astype(np.float32)[None])  # a batch of one
    clip = recognise.read_source(Source(Path("000021.npy"), content, hashlib.sha256(content).hexdigest()))
    shown = walk(80, rate).joints[:-1]
    expected = np.stack([shown[:, NODE_INDEX[node]] for node in clip.skeleton.names], axis=1)
    hips = clip.skeleton.names.index("hip_center")
    np.testing.assert_allclose(
        clip.positions - clip.positions[:, [hips]], expected - expected[:, [hips]], atol=1e-5
    )
    assert clip.rate == pytest.approx(rate)


def test_normalised_vectors_are_no_body() -> None:
    points, turned = known(80)
    numbers = vectors(points, turned)
    content = saved((numbers - numbers.mean(axis=0)) / numbers.std(axis=0))
    with pytest.raises(CaptureError, match="limbs that change their lengths"):
        recognise.read_source(Source(Path("000021.npy"), content, hashlib.sha256(content).hexdigest()))
