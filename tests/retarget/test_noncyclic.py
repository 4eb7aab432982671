"""Motions without gait: the stock motions on the body keep their shape above the ground."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.convert import on_nodes
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import IDENTITY, angle_between, from_axis_angle, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import NODES, SIDES, node_skeleton
from kinemimic.pipeline.readers.mocap.deepmimic import read_deepmimic, stock_motion
from kinemimic.retarget.feet.balance import LARGEST_LEAN
from kinemimic.retarget.feet.contact import sole_positions
from kinemimic.retarget.humanoid.body import node_offsets
from kinemimic.retarget.humanoid.limits import beyond_limits
from kinemimic.retarget.humanoid.motion import Motion, joint_angles, node_kinematics
from kinemimic.retarget.humanoid.surface import lowest_points
from kinemimic.retarget.measure import measure
from kinemimic.retarget.motion_warnings import held_feet_warnings, lean_warnings
from kinemimic.retarget.noncyclic import NonCyclicFit, _require_legs, fit_noncyclic
from kinemimic.retarget.optimise.refine import refine
from kinemimic.retarget.strides.excerpt import excerpt_of_pass


def stock(name: str) -> NonCyclicFit:
    clip = on_nodes(read_deepmimic(stock_motion(name)))
    return fit_noncyclic(clip, excerpt_of_pass(clip, 0))


def lowest(motion: Motion) -> float:
    return float(lowest_points(*motion.kinematics())[..., 2].min())


@pytest.mark.parametrize("name", ["jump", "kick", "roll", "cartwheel", "backflip", "dance_b"])
def test_stock_motions_keep_their_shape_above_the_ground_and_within_the_joints(name):
    fit = stock(name)
    motion = refine(fit.motion, fit.seen)
    assert not motion.cyclic
    assert lowest(motion) > -0.01
    assert max(beyond_limits(motion.rotations).values(), default=0.0) < np.radians(1.0)
    # Every node within some centimetres of where the recording has it, in the body's lengths.
    assert measure(motion, fit.positions, fit.phase).node_error < 0.03
    steps = np.degrees(angle_between(motion.rotations[1:], motion.rotations[:-1]))
    assert steps.max() < 40.0  # no flip: at 60 frames a second, 2,400 degrees a second
    assert np.linalg.norm(np.diff(motion.root, axis=0), axis=1).max() * motion.rate < 6.0


def test_a_jump_leaves_the_ground_and_falls_as_bodies_do():
    motion = refine(stock("jump").motion)
    height = sole_positions(*motion.kinematics())[..., 2].min(axis=(1, 2))
    flight = np.flatnonzero(height > 0.05)
    assert height.max() > 0.15 and not motion.contacts[flight].any()
    top = motion.root[flight[4:-4], 2]
    curve = np.polyfit(np.arange(len(top)) / motion.rate, top, 2)
    # The hips are not the centre of mass, and the legs fold and unfold about it.
    assert -15.0 < 2.0 * curve[0] < -5.0


def test_a_recording_between_frames_is_smooth():
    """A somersault at 16 frames per second: linear interpolation would make the velocity jump."""
    motion = stock("backflip").motion
    speed = np.diff(motion.root[:, 2]) * motion.rate
    flight = slice(35, 55)
    assert np.abs(np.diff(speed[flight])).max() < 2.5 * np.abs(np.diff(speed[flight])).mean()


def toes(positions: Array, side: str) -> Array:
    """Unit vectors (T, 3) from the ankle to the toes."""
    way = positions[:, N[f"foot_{side}"]] - positions[:, N[f"ankle_{side}"]]
    return np.asarray(way / np.linalg.norm(way, axis=-1, keepdims=True))


def recorded_toes(name: str, motion: Motion, side: str) -> tuple[Array, Array]:
    """Unit vectors (T, 3) at the motion's frames, in the recording's axes, and the ankle's height (T,)."""
    clip = on_nodes(read_deepmimic(stock_motion(name)))
    at = clip.times[0] + np.arange(len(motion.root)) / motion.rate
    way = np.stack([np.interp(at, clip.times, line) for line in toes(clip.positions, side).T], axis=1)
    height = np.interp(at, clip.times, clip.positions[:, N[f"ankle_{side}"], 2])
    return way / np.linalg.norm(way, axis=-1, keepdims=True), height


@pytest.mark.parametrize(("name", "side"), [("kick", "right"), ("jump", "left"), ("jump", "right")])
def test_feet_in_the_air_point_as_recorded(name, side):
    """But for one turn about the vertical (motions begin along +X), and one angle by which a foot that stands
    is made level."""
    fit = stock(name)
    assert fit.reliability.precise and fit.reliability.feet
    found = toes(fit.motion.kinematics()[0], side)
    recorded, height = recorded_toes(name, fit.motion, side)
    flight = height > height.min() + 0.1
    assert flight.sum() > 20
    # They move: a foot that was kept level would be found out.
    assert np.ptp(np.degrees(np.arcsin(recorded[flight, 2]))) > 60.0
    yaw = np.angle(np.sum((found[:, 0] + 1j * found[:, 1]) * (recorded[:, 0] - 1j * recorded[:, 1])))
    cosine = np.sum(found * rotate(from_axis_angle("Z", yaw), recorded), axis=1)
    off = np.degrees(np.arccos(np.minimum(cosine, 1.0)))
    assert off.max() < 20.0
    assert np.ptp(off[flight]) < 12.0


def test_without_toes_contacts_come_from_the_ankles_and_feet_are_flat():
    clip = on_nodes(read_deepmimic(stock_motion("jump")))
    positions = clip.positions.copy()
    positions[:, [N["foot_left"], N["foot_right"]]] = np.nan
    bare = replace(clip, positions=positions)
    fit = fit_noncyclic(bare, excerpt_of_pass(bare, 0))
    assert fit.reliability.precise and not fit.reliability.feet
    assert 0.2 < fit.motion.contacts.mean() < 0.95
    corners = sole_positions(*fit.motion.kinematics())[..., 2]
    # In the deepest crouch the ankle is at its limit.
    assert np.median(np.ptp(corners, axis=-1)[fit.motion.contacts]) < 0.001


def test_a_pivoting_foot_is_not_in_contact():
    """Nor while its ankle is low and still: anchored at one heading, it would rotate the body instead."""
    fit = stock("dance_a")
    for k, side in enumerate(("left", "right")):
        way, height = recorded_toes("dance_a", fit.motion, side)
        speed = np.degrees(np.abs(np.gradient(np.unwrap(np.arctan2(way[:, 1], way[:, 0]))))) * fit.motion.rate
        pivots = (speed > 300.0) & (height < height.min() + 0.1)
        assert pivots.sum() > 10
        assert not fit.motion.contacts[pivots, k].any()
        assert fit.motion.contacts[:, k].sum() > 10
    motion = refine(fit.motion, fit.seen)
    turned = np.degrees(angle_between(motion.rotations[:, 0], fit.motion.rotations[:, 0]))
    assert turned.max() < 10.0


def test_a_body_that_penetrates_lifts_only_the_root():
    fit = stock("jump")
    still = replace(
        fit.motion,
        root=np.repeat(fit.motion.root[:1], 60, axis=0),
        rotations=np.repeat(fit.motion.rotations[:1], 60, axis=0),
        contacts=np.zeros((60, 2), dtype=bool),
    )
    # On the back, 3 cm deep.
    q = still.rotations.copy()
    q[:, 0] = [0.0, -np.sin(np.pi / 4), 0.0, np.cos(np.pi / 4)]
    lying = replace(still, rotations=q)
    deep = replace(lying, root=lying.root - [0.0, 0.0, lowest(lying) + 0.03])
    found = refine(deep)
    assert lowest(found) > -0.004
    assert np.abs(found.root[:, :2] - deep.root[:, :2]).max() < 0.02


@pytest.mark.parametrize("name", ["jump", "kick", "cartwheel", "punch"])
def test_feet_that_land_and_leave_do_not_jerk_the_root(name):
    """Refinement reduces the root's jerk everywhere: contacts move the legs instead."""

    def largest_jerk(motion: Motion) -> float:
        acceleration = np.gradient(np.gradient(motion.root, axis=0), axis=0) * motion.rate**2
        return float(np.abs(np.diff(acceleration, axis=0)).max())

    plain = stock(name).motion
    assert largest_jerk(refine(plain)) < largest_jerk(plain)


@pytest.mark.parametrize(("after", "warns"), [(0.082, True), (0.03, False), (None, False)])
def test_feet_held_far_from_the_recording_are_a_warning(after: float | None, warns: bool) -> None:
    report = {"closed_form": {"node_error_m": 0.017}, "measures": {"node_error_m": after}}
    found = held_feet_warnings(report)
    assert bool(found) == warns
    assert not warns or ("is 82 mm from the recording" in found[0] and "without 17 mm" in found[0])


def test_a_body_turned_as_far_as_possible_may_sit() -> None:
    assert lean_warnings(0.0) == []
    assert "by 7° more" in lean_warnings(np.radians(7.0))[0]
    assert "a person who sits" in lean_warnings(LARGEST_LEAN)[0]


def test_a_leg_that_is_never_seen_is_named() -> None:
    positions = np.zeros((90, 20, 3))
    positions[3:, N["ankle_right"]] = np.nan
    positions[1:, N["knee_left"]] = np.nan
    with pytest.raises(KinemimicError, match="both legs in at least 2 frames, found knee_left in 1 of 90;"):
        _require_legs(positions)


def squats(noise: float, frames: int = 120) -> Clip:
    """Squats of 60° in 2 s each, of a person as a depth sensor sees them: node positions with noise, m."""
    knee = np.radians(30.0) * (1.0 - np.cos(np.pi * np.arange(frames) / 30.0))
    rotations = np.tile(IDENTITY, (frames, len(NODES), 1))
    for side in SIDES:
        for joint, share in (("hip", -0.5), ("knee", 1.0), ("ankle", -0.5)):
            rotations[:, N[f"{joint}_{side}"]] = from_axis_angle("Y", share * knee)
    root = np.zeros((frames, 3))
    root[:, 2] = 0.1 + 0.8 * np.cos(0.5 * knee)
    positions = node_kinematics(root, rotations, node_offsets())[0]
    positions += noise * np.random.default_rng(0).standard_normal(positions.shape)
    states = np.full(positions.shape[:2], 2, np.uint8)
    return Clip(node_skeleton(), np.arange(frames) / 30.0, positions, states, np.zeros(frames, np.int32), {})


@pytest.mark.parametrize("turned", [0.0, 60.0, 90.0, 180.0])
def test_a_knee_bends_as_far_whichever_way_the_person_faces(turned: float) -> None:
    """After a step to the side, or a turn, the person does not face along +X of the excerpt."""
    clip = squats(noise=0.02)
    excerpt = excerpt_of_pass(clip, 0)
    about = from_axis_angle("Z", np.radians(turned))
    there = replace(excerpt, positions=rotate(about, excerpt.positions))
    for side in SIDES:
        bent = np.degrees(joint_angles(fit_noncyclic(clip, there).motion.rotations)[f"knee_{side}"])
        assert np.percentile(bent, 95) == pytest.approx(60.0, abs=6.0)


def test_a_leg_that_is_not_seen_for_seconds_leaves_the_other_as_recorded() -> None:
    """Steps of the refinement as large as its linearisation asks for would grow from one to the next."""
    clip = squats(noise=0.012, frames=600)
    excerpt = excerpt_of_pass(clip, 0)
    positions = excerpt.positions.copy()
    for joint in ("knee", "ankle", "foot"):
        positions[50:550, N[f"{joint}_left"]] = np.nan
    fit = fit_noncyclic(clip, replace(excerpt, positions=positions))
    angles = joint_angles(refine(fit.motion, fit.seen).rotations)
    # It bends by 60°. Without the bound of the steps, it turned by up to 179°, its hip by 171°.
    assert np.degrees(np.abs(angles["knee_right"])).max() < 110.0
    assert np.degrees(np.abs(angles["hip_right"])).max() < 110.0


def test_a_knee_bends_as_far_in_a_person_who_lies() -> None:
    """Legs along the heading define no plane with it."""
    clip = squats(noise=0.01)
    excerpt = excerpt_of_pass(clip, 0)
    back = rotate(from_axis_angle("Y", -0.5 * np.pi), excerpt.positions)
    motion = fit_noncyclic(clip, replace(excerpt, positions=back)).motion
    expected = 30.0 * (1.0 - np.cos(np.pi * np.arange(len(motion.root)) / 60.0))
    for side in SIDES:
        bent = np.degrees(joint_angles(motion.rotations)[f"knee_{side}"])
        assert np.sqrt(np.mean((bent - expected) ** 2)) < 8.0
