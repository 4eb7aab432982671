"""Up, from balance: the tilt of a sensor comes back, and a level recording stays as it is."""

from __future__ import annotations

import numpy as np
import pytest
from samples.corpus import cmu
from samples.walker import along, walker

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, from_rotvec, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.pipeline.locomotion.even_clock import RATE, even_pass
from kinemimic.pipeline.locomotion.path.heading import along_heading, body_heading
from kinemimic.pipeline.locomotion.path.upright import center_of_mass, upright_axis
from kinemimic.pipeline.locomotion.phase.stride_phase import gait_phase
from kinemimic.pipeline.locomotion.strides import cut_strides, frames_of


def found_up(clip: Clip) -> tuple[Array, Array]:
    """Times and upright axes of a clip of one pass."""
    inside = clip.passes == 0
    even = even_pass(clip.times[inside], clip.positions[inside])
    assert even is not None
    heading, _ = body_heading(even.positions, RATE)
    apart = even.positions[:, N["ankle_right"]] - even.positions[:, N["ankle_left"]]
    phase = gait_phase(even.times, along_heading(apart, heading)[:, 0])
    assert phase is not None
    strides = cut_strides(even.times, even.positions, heading, phase)
    return even.times, upright_axis(even.positions, heading, phase, frames_of(strides, phase))


def angle(one: Array, other: Array) -> Array:
    return np.degrees(np.arccos(np.clip(np.sum(one * other, axis=-1), -1.0, 1.0)))


def there_and_back(noise: float) -> Clip:
    """A walk that turns by 180 degrees half-way."""
    clip = walker(seconds=16.0, noise=noise).clip
    return along(clip, np.pi * np.clip((clip.times - 7.5) / 1.1, 0.0, 1.0))


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("axis", ["X", "Y"])
def test_a_tilt_to_the_side_is_found_under_two_headings(axis: str, noise: float) -> None:
    """Roll of a walker along X shows as lean to the left on the way there, to the right on the way back."""
    clip = there_and_back(noise)
    turned = rotate(from_axis_angle("Z", 0.5 * np.pi if axis == "Y" else 0.0), clip.positions)
    tilt = from_axis_angle(axis, np.radians(5.0))
    clip.positions[:] = rotate(tilt, turned)
    times, up = found_up(clip)
    known = (times > 1.0) & (times < 7.0) | (times > 9.0) & (times < 15.0)
    expected = rotate(tilt, np.array([0.0, 0.0, 1.0]))
    assert angle(up[known], expected).mean() < 1.0


def test_a_level_recording_stays_as_it_is() -> None:
    for noise in (0.0, 0.01):
        _, up = found_up(there_and_back(noise))
        assert (up == [0.0, 0.0, 1.0]).all()


def test_a_forward_lean_is_no_tilt() -> None:
    clip = walker(seconds=8.0).clip
    clip.positions[:] = rotate(from_axis_angle("Y", np.radians(5.0)), clip.positions)
    assert angle(found_up(clip)[1], np.array([0.0, 0.0, 1.0])).max() < 1.5


@pytest.mark.parametrize("name", ["02_01", "05_01", "07_01", "07_12"])
def test_optical_walks_are_upright(name: str) -> None:
    assert angle(found_up(cmu(name))[1], np.array([0.0, 0.0, 1.0])).max() < 1.0


def test_the_centre_of_mass_of_a_standing_body_is_above_its_hips() -> None:
    positions = walker(seconds=3.3).clip.positions
    above = center_of_mass(positions) - positions[:, N["hip_center"]]
    assert ((above[:, 2] > 0.0) & (above[:, 2] < 0.25)).all()
    bare = positions.copy()
    bare[:, [N["hand_left"], N["hand_right"], N["head"]]] = np.nan
    assert np.abs(center_of_mass(bare) - center_of_mass(positions)).max() < 0.1


# Of the body's mass at each node: half of the share of every segment that it ends (Winter 2009, table 4.1:
# trunk 0.497, head 0.081, upper arm 0.028, forearm with hand 0.022, thigh 0.1, shank 0.0465, foot 0.0145;
# the last two rounded to 0.047 and 0.014).
NODE_SHARES = {
    "hip_center": 0.2485, "shoulder_center": 0.289, "head": 0.0405, "shoulder": 0.014, "elbow": 0.025,
    "wrist": 0.011, "hip": 0.05, "knee": 0.0735, "ankle": 0.0305, "foot": 0.007,
}  # fmt: skip


def shares() -> Array:
    """Of the 20 nodes; one in all."""
    sideless = [name.removesuffix("_left").removesuffix("_right") for name in NODES]
    found = np.array([NODE_SHARES.get(name, 0.0) for name in sideless])
    assert found.sum() == pytest.approx(1.0, abs=1e-12)
    return found


def any_poses(frames: int = 7) -> Array:
    return np.random.default_rng(2).standard_normal((frames, len(NODES), 3))


def test_the_centre_of_mass_is_the_sum_of_the_segments_shares() -> None:
    positions = any_poses()
    np.testing.assert_allclose(center_of_mass(positions), np.einsum("n,tni->ti", shares(), positions))


def test_the_centre_of_mass_moves_and_turns_with_the_body() -> None:
    positions = any_poses()
    turn, shift = from_rotvec(np.array([0.4, -1.0, 2.0])), np.array([3.0, -2.0, 0.7])
    moved = rotate(turn, center_of_mass(positions)) + shift
    np.testing.assert_allclose(center_of_mass(rotate(turn, positions) + shift), moved, atol=1e-12)


def test_a_node_that_is_missing_in_one_frame_changes_the_centre_of_mass_in_that_frame_only() -> None:
    """Without the head, the head's segment is left out, and the others weigh as much as before."""
    positions = any_poses()
    whole, lost = center_of_mass(positions), positions.copy()
    lost[3, N["head"]] = np.nan
    found = center_of_mass(lost)
    np.testing.assert_array_equal(np.delete(found, 3, axis=0), np.delete(whole, 3, axis=0))
    head = 0.081 * 0.5 * (positions[3, N["head"]] + positions[3, N["shoulder_center"]])
    np.testing.assert_allclose(found[3], (whole[3] - head) / 0.919)
    lost[3] = np.nan
    assert np.isnan(center_of_mass(lost)[3]).all()
