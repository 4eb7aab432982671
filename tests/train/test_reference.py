from __future__ import annotations

import numpy as np
import pytest

from kinemimic.pipeline.rotations import angle_between, from_rotvec, multiply
from kinemimic.retarget.motion import Motion
from kinemimic.train.reference import Reference


def test_goes_through_the_frames_of_the_motion(motion: Motion) -> None:
    phases = np.arange(len(motion.root)) / len(motion.root)
    reference = Reference(motion)
    np.testing.assert_allclose(reference.root(phases), motion.root, atol=1e-5)
    assert angle_between(reference.nodes(phases), motion.rotations).max() < 1e-4


def test_a_cyclic_motion_advances_by_its_offset_and_has_no_seam(motion: Motion) -> None:
    reference = Reference(motion)
    phases = np.array([0.0, 0.3, 0.999])
    np.testing.assert_allclose(
        reference.root(phases + 5) - reference.root(phases), np.tile([5.4, 0, 0], (3, 1)), atol=1e-9
    )
    around = reference.bodies(np.array([1 - 1e-6, 1 + 1e-6]))
    assert np.abs(np.diff(around.positions, axis=0)).max() < 1e-4
    assert np.abs(np.diff(around.linear, axis=0)).max() < 1e-2
    assert np.abs(np.diff(around.angular, axis=0)).max() < 1e-1


def test_velocities_are_the_derivatives(motion: Motion) -> None:
    reference, step, phases = Reference(motion), 1e-3, np.linspace(0.05, 1.9, 17)
    shift = step / reference.duration
    before, now, after = (reference.bodies(phases + k * shift) for k in (-1, 0, 1))
    np.testing.assert_allclose(now.linear, (after.positions - before.positions) / (2 * step), atol=2e-2)
    turned = multiply(from_rotvec(2 * step * now.angular), before.rotations)
    assert angle_between(turned, after.rotations).max() < 1e-4
    joints, velocities = reference.joints(phases)
    ahead = reference.joints(phases + shift)[0]
    assert angle_between(multiply(joints, from_rotvec(step * velocities)), ahead).max() < 1e-4


def test_any_other_motion_holds_its_last_frame(motion: Motion) -> None:
    once = Reference(Motion(motion.rate, motion.root, motion.rotations, motion.contacts, cyclic=False))
    assert once.duration == pytest.approx((len(motion.root) - 1) / motion.rate)
    late = once.bodies(np.array([1.0, 1.7]))
    np.testing.assert_allclose(late.positions[0], late.positions[1])
    assert np.abs(late.linear[1]).max() == 0.0
