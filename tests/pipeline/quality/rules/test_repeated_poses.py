"""Long repeats of a pose: a person who stands, a frozen sensor, or nobody."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from samples.walker import stand_walk_stand

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.quality.rules.repeated_poses import long_repeats

Build = Callable[..., Clip]


def runs_of(clip: Clip) -> dict[str, list[int]]:
    found = long_repeats(clip)
    masks = {"stands": found.stands, "frozen": found.frozen, "nobody": found.nobody}
    return {name: np.flatnonzero(mask).tolist() for name, mask in masks.items() if mask.any()}


def held(clip: Clip, first: int, last: int) -> Clip:
    positions = clip.positions.copy()
    positions[first : last + 1] = positions[first - 1]
    return replace(clip, positions=positions)


def test_a_body_that_moves_before_and_after_was_frozen(node_clip: Build) -> None:
    assert runs_of(held(node_clip(90), 30, 39)) == {"frozen": list(range(30, 40))}
    assert runs_of(held(node_clip(90), 30, 34)) == {}


def test_a_longer_repeat_and_one_at_the_end_are_nobody(node_clip: Build) -> None:
    assert runs_of(held(node_clip(90), 30, 50)) == {"nobody": list(range(30, 51))}
    walks = node_clip(90)
    walks.positions[..., 0] += walks.times[:, None]
    assert runs_of(held(walks, 80, 89)) == {"nobody": list(range(80, 90))}


def test_a_body_that_comes_to_rest_stands() -> None:
    clip = stand_walk_stand(rate=120.0)
    found = long_repeats(clip)
    assert not found.nobody.any() and not found.frozen.any()
    assert found.stands[1:300].all() and found.stands[-300:].all()


@pytest.mark.parametrize(("channels", "expected"), [(None, "nobody"), (0.3, "stands"), (0.0, "nobody")])
def test_one_pose_alone_stands_only_in_recorded_channels(
    node_clip: Build, channels: float | None, expected: str
) -> None:
    """Channels that are all zero are the skeleton's rest pose."""
    clip = held(node_clip(60), 1, 59)
    if channels is not None:
        clip = replace(clip, euler=np.full(clip.positions.shape, channels), orders=("ZYX",) * 20)
    assert runs_of(clip) == {expected: list(range(60))}
