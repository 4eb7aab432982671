from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from kinemimic.pipeline.kinematics.rotations import angle_between, from_rotvec, multiply
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.reference.reference import Reference
from kinemimic.train.sim.world import BodyStates


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


def test_a_non_cyclic_motion_holds_its_last_frame(motion: Motion) -> None:
    once = Reference(Motion(motion.rate, motion.root, motion.rotations, motion.contacts, cyclic=False))
    assert once.duration == pytest.approx((len(motion.root) - 1) / motion.rate)
    late = once.bodies(np.array([1.0, 1.7]))
    np.testing.assert_allclose(late.positions[0], late.positions[1])
    assert np.abs(late.linear[1]).max() == 0.0


@pytest.mark.parametrize("cyclic", [True, False])
def test_vectorised_phases_equal_single_phases(motion: Motion, cyclic: bool) -> None:
    """One look-up for all times of a step equals single look-ups to the bit."""
    reference = Reference(replace(motion, cyclic=cyclic))
    phases = np.random.default_rng(0).uniform(0.0, 2.5, (3, 4))
    whole = [*(getattr(reference.bodies(phases), f.name) for f in fields(BodyStates))]
    whole += [*reference.joints(phases), reference.nodes(phases), reference.root(phases)]
    for k in np.ndindex(phases.shape):
        one = phases[k].reshape(1)
        alone = [*(getattr(reference.bodies(one), f.name) for f in fields(BodyStates))]
        alone += [*reference.joints(one), reference.nodes(one), reference.root(one)]
        for all_of, single in zip(whole, alone, strict=True):
            np.testing.assert_array_equal(all_of[k], single[0])


def test_between_two_rows_of_the_tables_values_are_linear_and_rotations_of_unit_length(
    motion: Motion,
) -> None:
    reference = Reference(motion)
    rows = round(motion.duration * 960)  # the tables' own steps
    ends, middle = np.array([7.0, 8.0]) / rows, np.array([7.25]) / rows
    around, between = reference.bodies(ends), reference.bodies(middle)
    for name in ("positions", "linear", "angular"):
        first, second = getattr(around, name)
        np.testing.assert_allclose(getattr(between, name)[0], 0.75 * first + 0.25 * second, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(between.rotations, axis=-1), 1.0, atol=1e-15)


def test_velocities_are_zero_after_the_last_frame(motion: Motion) -> None:
    once = Reference(replace(motion, cyclic=False))
    _, velocities = once.joints(np.array([0.5, 1.0, 1.01]))
    assert np.abs(velocities[:2]).max() > 0.1
    assert np.abs(velocities[2]).max() == 0.0
