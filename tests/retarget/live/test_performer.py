"""A walker on the body, moment by moment, against the curves and the speed that it was made of."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from samples.walker import changing_bones, in_place, joined, walker
from samples.walker import standing as held

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import angle_between, from_axis_angle, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.pipeline.live.capture import LiveCapture
from kinemimic.pipeline.live.frame import frame_of
from kinemimic.retarget.feet.contact import sole_positions
from kinemimic.retarget.feet.scale import body_kinematics
from kinemimic.retarget.humanoid.motion import joint_angles
from kinemimic.retarget.humanoid.surface import lowest_points
from kinemimic.retarget.live.performer import FADE_TIME, NOISE_TIME, Performed, Performer, standing

RATE = 30.0
WALKER = walker(seconds=4.0, rate=30.0)
CLIP = WALKER.clip
TIMES = CLIP.times - CLIP.times[0]


def follow(clip: Clip) -> tuple[Performer, list[tuple[float, Performed]]]:
    """Moments' times and the reference's frames while a clip comes in."""
    return follow_positions(clip.times - clip.times[0], clip.positions)


def follow_positions(times: Array, positions: Array) -> tuple[Performer, list[tuple[float, Performed]]]:
    """The same for positions (T, 20, 3) at times (T,)."""
    capture, performer = LiveCapture(step=1.0 / RATE), Performer(RATE)
    out, k = list[tuple[float, Performed]](), 0
    for n in range(int(times[-1] * RATE)):
        while k < len(times) and times[k] <= n / RATE + 1e-9:
            capture.take(frame_of(times[k], positions[k]))
            k += 1
        moment = capture.advance()
        out.append((np.nan if moment is None else moment.time, performer.perform(moment)))
    return performer, out


@cache
def performed() -> tuple[Performer, list[tuple[float, Performed]]]:
    return follow(CLIP)


def test_knees_and_hips_are_the_walkers() -> None:
    _, frames = performed()
    followed = [(at, one) for at, one in frames if one.presence >= 1.0]
    curves = joint_angles(np.array([one.rotations for _, one in followed]))
    # The walker's phase is 0 where the first harmonic of the ankles, over three strides of 33 frames, has the
    # left one farthest ahead.
    ahead = (CLIP.positions[:99, N["ankle_left"]] - CLIP.positions[:99, N["ankle_right"]])[:, 0]
    begin = np.angle(np.sum(ahead * np.exp(2j * np.pi * TIMES[:99] / WALKER.period))) / (2.0 * np.pi)
    true = WALKER.curves(np.array([at for at, _ in followed]) / WALKER.period - begin)
    for name, curve in curves.items():
        assert np.sqrt(np.mean((curve - true[name]) ** 2)) < np.radians(3.0), name


def test_the_body_goes_as_far_as_the_person_at_its_size() -> None:
    _, frames = performed()
    followed = [(at, one) for at, one in frames if one.presence >= 1.0]
    way = followed[-1][1].root - followed[0][1].root
    seconds = followed[-1][0] - followed[0][0]
    assert np.isclose(np.hypot(way[0], way[1]), WALKER.speed / WALKER.size * seconds, rtol=0.03)
    # It walks ahead: nobody was there before, so that ahead is +X.
    assert abs(way[1]) < 0.15 * way[0]


def test_a_treadmill_that_starts_is_followed_at_once() -> None:
    still, walking = 2.0, in_place(CLIP)
    _, frames = follow(joined(held(walking, still), walking))
    at, gone = np.array([(at, np.hypot(*one.root[:2])) for at, one in frames if np.isfinite(at)]).T
    began, later = np.interp([still, still + 2.0], at, gone)
    assert began < 0.1
    # The walker's stiff feet roll over their corners as no foot does.
    assert np.isclose((later - began) / 2.0, WALKER.speed / WALKER.size, rtol=0.2)


def test_noise_is_what_a_walk_shows_whose_bones_change() -> None:
    """It comes in over NOISE_TIME and goes in FADE_TIME; of a precise capture there is none."""
    assert all(one.noise == 0.0 for _, one in performed()[1])
    performer, frames = follow(changing_bones(CLIP))
    noise = np.array([one.noise for _, one in frames])
    followed = np.cumsum([one.presence >= 1.0 for _, one in frames]) / RATE
    assert noise[followed == 0.0].max() == 0.0
    assert np.all(noise <= np.minimum(1.0, followed / NOISE_TIME) + 1e-9)
    assert np.allclose(noise[followed > NOISE_TIME], 1.0)
    lost = np.array([performer.perform(None).noise for _ in range(round(2.0 * RATE))])
    assert np.diff(lost, prepend=1.0).min() > -1.1 / (FADE_TIME * RATE)
    assert lost[-1] == 0.0


def test_the_lowest_part_is_on_the_ground() -> None:
    _, frames = performed()
    rotations = np.array([one.rotations for _, one in frames])
    root = np.array([one.root for _, one in frames])
    lowest = lowest_points(*body_kinematics(rotations, root))[..., 2].min(axis=1)
    assert np.abs(lowest).max() < 0.03


def test_nobody_is_a_person_who_stands() -> None:
    performer, frames = follow(walker(seconds=1.6, rate=RATE).clip)
    assert performer.people == 1
    after = [performer.perform(None) for _ in range(round((FADE_TIME + 1.0) * RATE))]
    assert performer.lost == 1
    assert after[-1].presence == 0.0
    assert np.allclose(after[-1].root, after[-2].root)
    assert angle_between(after[-1].rotations[1:], standing()[1:]).max() < 1e-6
    # No jump anywhere: neither of a joint nor of the hips.
    whole = [one for _, one in frames] + after
    for one, two in pairwise(whole):
        assert angle_between(one.rotations, two.rotations).max() < 0.8
        assert np.linalg.norm(two.root - one.root) < 0.12


@pytest.mark.parametrize("missing", ["spine", "hip_center"])
def test_a_joint_of_the_trunk_that_is_never_seen_does_not_turn_the_body(missing: str) -> None:
    """A pelvis at the origin counts as not seen; the walker's heading is 60 degrees to the left."""
    turn = from_axis_angle("Z", np.radians(60.0))
    positions = rotate(turn, CLIP.positions)
    if missing == "hip_center":
        positions = positions - positions[:, :1]
    positions[:, N[missing]] = 0.0
    _, frames = follow_positions(TIMES, positions)
    shown = [one.rotations for _, one in frames if one.presence >= 1.0]
    ahead = np.array([rotate(one[0], np.array([1.0, 0.0, 0.0])) for one in shown])
    yaw = np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))
    assert len(yaw) > 60
    assert np.abs(np.diff(yaw)).max() < np.radians(5.0)
    assert np.ptp(yaw) < np.radians(25.0)


def test_feet_that_a_precise_sensor_does_not_have_are_those_of_its_gait() -> None:
    """Without toes, soles in stance would take the shanks' pitch."""
    positions = CLIP.positions.copy()
    for side in SIDES:
        positions[:, N[f"foot_{side}"]] = np.nan
    _, frames = follow_positions(TIMES, positions)
    shown = [one for _, one in frames if one.presence >= 1.0]
    assert len(shown) > 60
    rotations, root = (np.array([getattr(one, name) for one in shown]) for name in ("rotations", "root"))
    corners = sole_positions(*body_kinematics(rotations, root))[..., 2]
    # The lower foot of each moment, from its highest to its lowest corner, over 16 cm.
    lower = corners.min(axis=2).argmin(axis=1)
    slope = np.ptp(corners[np.arange(len(corners)), lower], axis=1) / 0.16
    assert np.degrees(np.mean(np.arcsin(np.minimum(slope, 1.0)))) < 8.0


def test_somebody_else_who_stands_elsewhere_is_no_walk() -> None:
    """The person leaves, nobody is seen for a while, and another one stands 2.5 m to the side."""
    first, second = walker(seconds=1.6, rate=RATE).clip, held(CLIP, 1.5)
    nobody = np.full((round(0.6 * RATE), *first.positions.shape[1:]), np.nan)
    other = 0.8 * second.positions + [0.0, 2.5, 0.0]
    positions = np.concatenate([first.positions, nobody, other])
    _, frames = follow_positions(np.arange(len(positions)) / RATE, positions)
    root = np.array([one.root for _, one in frames])
    after = root[len(first.times) + len(nobody) :, :2]
    speed = RATE * np.linalg.norm(np.diff(after, axis=0), axis=1)
    assert speed.max() < 1.0
