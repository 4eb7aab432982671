"""The known motion as a clip without defects, for tests to modify."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from samples import motion

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import IDENTITY
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES, node_skeleton
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.format import Format

# Each node's counterpart on the other side; midline nodes are their own counterpart.
OTHER_SIDE: list[int] = [
    NODE_INDEX[name.replace("left", "#").replace("right", "left").replace("#", "right")] for name in NODES
]


def clip_of(times: Array, joints: Array) -> Clip:
    """A clip of the 20 nodes at joints (T, 20, 3), in our axes."""
    clip = clip_of_points(
        node_skeleton(),
        times,
        joints,
        None,
        format=Format("made here", "none", "positions", "nothing"),
        reading=reading(units="m", units_rule="made so"),
        world_from_file=IDENTITY,
    )
    return replace(clip, provenance={**clip.provenance, "source": "made here", "sha256": "0" * 64})


@pytest.fixture
def moving() -> Callable[..., Clip]:
    """The walk (or the run) as a perfect sensor sees it, or with white noise (metres) on it."""

    def build(frames: int = 120, *, rate: float = 30.0, kind: str = "walk", noise: float = 0.0) -> Clip:
        shown = motion.walk(frames, rate, motion=kind)
        error = noise * np.random.default_rng(0).standard_normal(shown.joints.shape)
        return clip_of(shown.times, shown.joints + error)

    return build


@pytest.fixture
def other_side() -> list[int]:
    """Each node's counterpart."""
    return OTHER_SIDE
