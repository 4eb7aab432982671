"""The residual force of motions that the ground carries, and of some that it cannot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from peers.trackers import shipped_motion

from kinemimic.pipeline.gravity import GRAVITY
from kinemimic.pipeline.kinematics.rotations import IDENTITY
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.retarget.humanoid.body import STANDING_HEIGHT
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.reference.residual import residual
from kinemimic.train.sim.world import FRICTION


def moved(root: np.ndarray) -> Motion:
    """A standing humanoid whose hips take a path (T, 3) at 60 Hz."""
    rotations = np.tile(IDENTITY, (len(root), len(NODES), 1))
    return Motion(60.0, root, rotations, np.zeros((len(root), 2), dtype=bool), cyclic=False)


def test_standing_needs_nothing_and_floating_needs_the_weight() -> None:
    stand = np.tile([0.0, 0.0, STANDING_HEIGHT], (30, 1))
    assert residual(moved(stand)) < 0.01
    assert residual(moved(stand + np.array([0.0, 0.0, 1.0]))) == pytest.approx(1.0, abs=1e-6)


def test_a_falling_body_needs_no_force() -> None:
    at = np.arange(60) / 60.0
    fall = np.stack([0.0 * at, 0.0 * at, 10.0 - 0.5 * GRAVITY * at**2], axis=-1)
    # One-sided differences at both ends.
    assert residual(moved(fall)) < 0.04


def test_an_acceleration_beyond_friction_is_missing() -> None:
    """In the air nothing pushes: the residual is the acceleration with gravity, by Newton's second law."""
    at = np.arange(60) / 60.0
    pushed = np.stack([0.5 * FRICTION * GRAVITY * at**2, 0.0 * at, 2.0 + 0.0 * at], axis=-1)
    assert residual(moved(pushed)) == pytest.approx(np.hypot(1.0, FRICTION), rel=0.03)


def test_a_recorded_walk_needs_less_than_one_that_wobbles() -> None:
    walk = shipped_motion("walk")
    own = residual(walk)
    assert own < 0.2
    phase = 2.0 * np.pi * np.arange(len(walk.root)) / len(walk.root)
    sway = np.stack([0.0 * phase, 0.1 * np.sin(3.0 * phase), 0.0 * phase], axis=-1)
    assert residual(replace(walk, root=walk.root + sway)) > own + 0.1
