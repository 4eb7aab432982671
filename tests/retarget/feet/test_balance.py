from __future__ import annotations

import numpy as np
import pytest

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import angle_between, from_axis_angle, multiply, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.retarget.feet.balance import EDGE, LARGEST_LEAN, MARGIN, centre_of_mass, upright
from kinemimic.retarget.feet.contact import sole_positions
from kinemimic.retarget.feet.scale import body_kinematics
from kinemimic.retarget.humanoid.body import STANDING_HEIGHT
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.library.exercises import exercise

FRAMES = 40
ANKLES = (NODE_INDEX["ankle_left"], NODE_INDEX["ankle_right"])


def standing() -> tuple[Array, Array]:
    """Rotations (T, 20, 4) and root (T, 3) of the neutral pose."""
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (FRAMES, 20, 1))
    return rotations, np.tile([0.0, 0.0, STANDING_HEIGHT], (FRAMES, 1))


def leaning(angle: float, axis: str = "Y") -> tuple[Array, Array]:
    """The neutral pose as a sensor sees it that is tilted by an angle, rad."""
    rotations, root = standing()
    turn = np.broadcast_to(from_axis_angle(axis, angle), (FRAMES, 4))
    rotations[:, 0] = multiply(turn, rotations[:, 0])
    return rotations, rotate(turn, root)


def test_the_centre_of_mass_of_the_neutral_pose() -> None:
    """By hand from Table 1: only the feet are ahead of the pelvis' axis, by 4 cm. Heights of the centres:
    0.905 m of the pelvis, 1.18 and 1.495 of torso and head, 1.19, 0.915 and 0.75 of the arms' parts, 0.63,
    0.24 and 0.025 of the legs'."""
    centre = centre_of_mass(*body_kinematics(*standing()))[0]
    assert centre[0] == pytest.approx(2 * 1.2 * 0.04 / 48.2)
    assert centre[1] == pytest.approx(0.0, abs=1e-12)
    moment = 5.8 * 0.905 + 15.0 * 1.18 + 2.2 * 1.495
    moment += 2 * (1.6 * 1.19 + 1.0 * 0.915 + 0.8 * 0.75 + 5.2 * 0.63 + 2.8 * 0.24 + 1.2 * 0.025)
    assert centre[2] == pytest.approx(moment / 48.2, abs=1e-9)


def test_an_arm_out_to_the_left_shifts_the_centre_of_mass_by_its_masses_and_levers() -> None:
    """1.6, 1.0 and 0.8 kg at 0.15, 0.425 and 0.59 m from the shoulder go up and to the left."""
    rotations, root = standing()
    before = centre_of_mass(*body_kinematics(rotations, root))
    rotations[:, NODE_INDEX["shoulder_left"]] = from_axis_angle("X", 0.5 * np.pi)
    shift = centre_of_mass(*body_kinematics(rotations, root)) - before
    lever = (1.6 * 0.15 + 1.0 * 0.425 + 0.8 * 0.59) / 48.2
    np.testing.assert_allclose(shift, np.tile([0.0, lever, lever], (FRAMES, 1)), atol=1e-9)


@pytest.mark.parametrize(("axis", "degrees"), [("Y", 10.0), ("Y", -8.0), ("X", 14.0)])
def test_a_body_that_would_fall_is_turned_until_it_stands(axis: str, degrees: float) -> None:
    rotations, root = leaning(np.radians(degrees), axis)
    contacts = np.ones((FRAMES, 2), dtype=np.bool_)
    turned, path, lean = upright(rotations, root, contacts)
    assert 0.0 < np.degrees(lean) < abs(degrees)
    positions, frames = body_kinematics(turned, path)
    soles = sole_positions(positions, frames).reshape(FRAMES, 8, 3)[..., :2]
    centre = centre_of_mass(positions, frames)[:, :2]
    assert (centre > soles.min(axis=1) + 0.5 * MARGIN).all()
    assert (centre < soles.max(axis=1) - 0.5 * MARGIN).all()
    # The feet keep their orientation, the joints but for the ankles their angles.
    before = body_kinematics(rotations, root)[1]
    for ankle in ANKLES:
        assert angle_between(before[:, ankle], frames[:, ankle]).max() < 1e-6
    others = [node for node in range(1, 20) if node not in ANKLES]
    np.testing.assert_array_equal(turned[:, others], rotations[:, others])


def test_a_body_that_stands_does_not_change() -> None:
    motion: Motion = exercise(0, 4)
    for contacts in (motion.contacts, np.zeros_like(motion.contacts)):
        turned, path, lean = upright(motion.rotations, motion.root, contacts)
        assert lean == 0.0
        assert turned is motion.rotations
        assert path is motion.root


def test_a_body_on_its_way_may_lean() -> None:
    rotations, root = leaning(np.radians(10.0))
    contacts = np.ones((FRAMES, 2), dtype=np.bool_)
    away = root + np.linspace(0.0, 0.6, FRAMES)[:, None] * [1.0, 0.0, 0.0]
    assert upright(rotations, away, contacts)[2] == 0.0
    flying = contacts & (np.arange(FRAMES) < FRAMES // 2)[:, None]
    assert upright(rotations, root, flying)[2] == 0.0


def test_the_turn_has_a_limit() -> None:
    rotations, root = leaning(np.radians(40.0))
    _, _, lean = upright(rotations, root, np.ones((FRAMES, 2), dtype=np.bool_))
    assert lean == pytest.approx(LARGEST_LEAN)


def test_for_a_simulated_body_the_edges_of_the_soles_do_not_count() -> None:
    """It stands on its toes: turned until the centre of mass is over the middle of the feet."""
    rotations, root = leaning(np.radians(6.0))
    contacts = np.ones((FRAMES, 2), dtype=np.bool_)
    assert upright(rotations, root, contacts)[2] == 0.0
    turned, path, lean = upright(rotations, root, contacts, edge=EDGE)
    assert 0.0 < np.degrees(lean) < 6.0
    positions, frames = body_kinematics(turned, path)
    soles = sole_positions(positions, frames).reshape(FRAMES, 8, 3)[..., 0]
    centre = centre_of_mass(positions, frames)[:, 0]
    assert (centre < soles.max(axis=1) - EDGE).all()


def test_only_feet_that_stand_carry() -> None:
    """On the left foot alone, the body leans to the left; on both it stands."""
    rotations, root = standing()
    one = np.tile([True, False], (FRAMES, 1))
    turned, path, lean = upright(rotations, root, one)
    assert lean > 0.02
    positions, frames = body_kinematics(turned, path)
    left = sole_positions(positions, frames)[:, 0, :, 1]
    centre = centre_of_mass(positions, frames)[:, 1]
    assert (centre > left.min(axis=1)).all()
    assert upright(rotations, root, np.ones((FRAMES, 2), dtype=np.bool_))[2] == 0.0


def test_a_short_part_of_a_walk_is_not_standing() -> None:
    rotations, root = leaning(np.radians(10.0))
    contacts = np.ones((FRAMES, 2), dtype=np.bool_)
    walking = root + 0.4 * np.linspace([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], FRAMES)
    assert upright(rotations, walking, contacts, 60.0)[2] == 0.0
    assert upright(rotations, walking, contacts, 10.0)[2] > 0.0


@pytest.mark.parametrize("degrees", [-90.0, 90.0, 180.0])
def test_a_body_that_lies_or_is_on_its_hands_does_not_lean(degrees: float) -> None:
    rotations, root = leaning(np.radians(degrees))
    contacts = np.ones((FRAMES, 2), dtype=np.bool_)
    turned, path, lean = upright(rotations, root, contacts)
    assert lean == 0.0
    assert turned is rotations
    assert path is root
