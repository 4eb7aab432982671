from __future__ import annotations

import numpy as np
import pytest

from kinemimic.evaluate.simulate.session.effects import DAMPING, Effects, heading_turn, spring, weights
from kinemimic.evaluate.simulate.session.inputs import Carry, Drag, Push, Release
from kinemimic.pipeline.gravity import GRAVITY
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, rotate
from kinemimic.retarget.humanoid.body import BODIES, BODY_INDEX
from kinemimic.train.scenario.event_schedule import slope_tilt
from kinemimic.train.sim.world import BodyStates

LEVEL = np.zeros(3)
TORSO, HAND = BODY_INDEX["torso"], BODY_INDEX["hand_left"]


def bodies(heading: float = 0.0) -> BodyStates:
    turned = np.tile(from_axis_angle("Z", np.array([heading]))[0], (1, 15, 1))
    return BodyStates(np.zeros((1, 15, 3)), turned, np.zeros((1, 15, 3)), np.zeros((1, 15, 3)))


def test_a_push_acts_ahead_of_the_humanoid_for_its_steps() -> None:
    effects, facing_left = Effects(), bodies(0.5 * np.pi)
    effects.apply(Push("torso", force=(100.0, 0.0, 0.0), torque=(0.0, 0.0, 5.0), steps=2), facing_left)
    found = [effects.wrenches(facing_left, LEVEL)[0][0] for _ in range(3)]
    np.testing.assert_allclose(found[0][TORSO], [0.0, 100.0, 0.0, 0.0, 0.0, 5.0], atol=1e-9)
    np.testing.assert_array_equal(found[0], found[1])
    assert not found[2].any()


def test_a_growing_push_has_its_mean_over_each_step() -> None:
    effects = Effects()
    effects.apply(Push("torso", force=(40.0, 0.0, 0.0), steps=4, growing=True), bodies())
    found = [float(effects.wrenches(bodies(), LEVEL)[0][0, TORSO, 0]) for _ in range(4)]
    assert found == pytest.approx([5.0, 15.0, 25.0, 35.0])


def test_a_weight_hangs_until_it_is_taken_away() -> None:
    effects = Effects()
    effects.apply(Carry("hand_left", 3.0), bodies())
    assert effects.wrenches(bodies(), LEVEL)[0][0, HAND, 2] == pytest.approx(-3.0 * GRAVITY)
    effects.apply(Carry("hand_left", 0.0), bodies())
    assert not effects.wrenches(bodies(), LEVEL)[0].any()


def test_a_slope_tilts_gravity() -> None:
    mass = sum(body.mass for body in BODIES)
    np.testing.assert_allclose(
        weights(slope_tilt(0.1, 0.0)).sum(axis=0),
        mass * GRAVITY * np.array([-np.sin(0.1), 0.0, 1.0 - np.cos(0.1)]),
        atol=1e-9,
    )


def test_a_carried_weight_hangs_along_gravity_on_a_slope() -> None:
    effects = Effects()
    effects.apply(Carry("hand_left", 2.0), bodies())
    found = effects.wrenches(bodies(), slope_tilt(0.1, 0.0))[0][0]
    np.testing.assert_allclose(found[HAND, :3], 2.0 * GRAVITY * np.array([-np.sin(0.1), 0.0, -np.cos(0.1)]))
    assert np.flatnonzero(found.any(axis=-1)).tolist() == [HAND]


def test_a_spring_pulls_to_the_pointer_within_its_limit() -> None:
    """At rest: F = k d / (1 + (k dt + c) dt / m)."""
    drag = Drag("torso", (0.0, 0.0, 0.0), (0.1, 0.0, 0.0), stiffness=200.0, limit=300.0)
    dt, mass = 1.0 / 30.0, BODIES[TORSO].mass
    expected = 20.0 / (1.0 + (200.0 * dt + 200.0 * DAMPING) * dt / mass)
    np.testing.assert_allclose(spring(drag, bodies())[2], [expected, 0.0, 0.0])
    far = Drag("torso", (0.0, 0.0, 0.0), (50.0, 0.0, 0.0), stiffness=200.0, limit=70.0)
    np.testing.assert_allclose(spring(far, bodies())[2], [70.0, 0.0, 0.0])


def test_a_drag_turns_the_body_about_its_centre_until_its_release() -> None:
    effects = Effects()
    effects.apply(Drag("torso", (0.0, 0.2, 0.0), (1.0, 0.2, 0.0), stiffness=100.0), bodies())
    wrench, shown = effects.wrenches(bodies(), LEVEL)
    assert shown is not None
    np.testing.assert_allclose(shown[0], [0.0, 0.2, 0.0])
    np.testing.assert_allclose(wrench[0, TORSO, 3:], [0.0, 0.0, -0.2 * shown[2, 0]])
    effects.apply(Release(), bodies())
    wrench, shown = effects.wrenches(bodies(), LEVEL)
    assert shown is None
    assert not wrench.any()


def test_the_heading_ignores_the_lean() -> None:
    states = bodies(0.7)
    np.testing.assert_allclose(
        rotate(heading_turn(states), np.array([1.0, 0.0, 0.0])), [np.cos(0.7), np.sin(0.7), 0.0], atol=1e-12
    )
