from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from peers.trackers import shipped_motion

from kinemimic.pipeline.kinematics.rotations import from_axis_angle, multiply
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.tracker.suitability import unsuitable


@pytest.fixture(scope="module")
def walk() -> Motion:
    return shipped_motion("walk")


@pytest.mark.parametrize("name", ["walk", "run"])
def test_walks_and_runs_are_suitable(name: str) -> None:
    assert unsuitable(shipped_motion(name)) is None


def leaning(motion: Motion, degrees: float) -> Motion:
    """Bent forward in frame 7, about the hips."""
    rotations = motion.rotations.copy()
    rotations[7, 0] = multiply(from_axis_angle("Y", np.array(np.radians(degrees))), rotations[7, 0])
    return replace(motion, rotations=rotations)


def test_a_pelvis_that_leans_far_is_named(walk: Motion) -> None:
    assert unsuitable(leaning(walk, 20.0)) is None
    found = unsuitable(leaning(walk, 80.0))
    assert found is not None
    assert "the pelvis leaning by" in found
    assert "in frame 7" in found


@pytest.mark.parametrize(("sunk", "found"), [(0.4, "the knee .* m above the ground"), (0.1, None)])
def test_a_body_near_the_ground_is_named(walk: Motion, sunk: float, found: str | None) -> None:
    lowered = unsuitable(replace(walk, root=walk.root - np.array([0.0, 0.0, sunk])))
    assert (lowered is None) == (found is None)
    if lowered:
        assert lowered.startswith("the knee")


def test_stairs_are_named(walk: Motion) -> None:
    rise = np.linspace(0.0, 0.4, len(walk.root))[:, None] * np.array([0.0, 0.0, 1.0])
    assert unsuitable(replace(walk, root=walk.root + rise)) == "hips that climb or sink by 0.40 m"
