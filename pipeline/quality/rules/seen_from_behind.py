"""Detects walks in which the person is seen from behind, and swaps left and right in them.

Kinect v1 and v2 assume that every body faces the sensor, and so swap the sides of a person who walks away.
There the body seems to walk backward on knees that bend forward. (The knees of a person who really walks
backward bend the usual way.) A pass in which somebody turns round is divided where the sides change. The
toes, which the sensor invents, pointing towards itself, stay in place and are marked as inferred. Euler
captures are only flagged.
"""

from __future__ import annotations

from itertools import pairwise, starmap

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.body_points import nodes_of
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.joint_names import joints_by_name
from kinemimic.pipeline.kinematics.skeleton import INFERRED, NODES
from kinemimic.pipeline.kinematics.spans import frame_runs
from kinemimic.pipeline.locomotion.striding import VELOCITY_SECONDS, striding_frames
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.quality.rules.frame_selection import select_frames
from kinemimic.pipeline.quality.rules.mirrored_body import foot_and_knee_directions
from kinemimic.pipeline.quality.rules.swap_sides import opposite_sides, swap_sides
from kinemimic.pipeline.quality.rules.turning_camera import ground_moves

# Share of the path walked in the facing direction, -1 if all of it is backward: of the hips' path over a
# floor, or of the path relative to the planted foot on a belt, where the wrong foot is sometimes chosen.
MAX_FORWARD_SHARE = -0.7
MAX_FORWARD_SHARE_ON_BELT = -0.3
# Share of the clearly bent knees that bend forward; up to 0.4 in walks towards a Kinect v1.
MIN_FORWARD_KNEES = 0.45
MIN_SAMPLES = 8
# m of path in striding frames, to the front or to the back: two steps.
MIN_WAY = 0.8
TURN_TIME = 1.0  # s from the first or last stride to the back in which the sides change


def repair(clip: Clip) -> tuple[Clip, list[Defect]]:
    """The clip with left and right swapped where the person is seen from behind."""
    found = striding_frames(clip)
    on_belt = len(found.frames) >= MIN_SAMPLES and ground_moves(found)
    velocity, limit = (
        (found.walking_velocity, MAX_FORWARD_SHARE_ON_BELT)
        if on_belt
        else (found.hip_velocity, MAX_FORWARD_SHARE)
    )
    swapped = np.zeros(len(clip.times), dtype=np.bool_)
    for number in range(int(clip.passes.max(initial=-1)) + 1):
        inside = np.flatnonzero(clip.passes == number)
        strides = np.flatnonzero(clip.passes[found.frames] == number)
        times = clip.times[found.frames[strides]]
        forward = np.sum(velocity[strides] * found.forward[strides], axis=1)
        length = np.linalg.norm(velocity[strides], axis=1)
        # Nobody turns round on a belt.
        whole = slice(0, len(strides))
        for part, walk in [(whole, whole)] if on_belt else _parts(forward, times):
            if len(times[part]) < MIN_SAMPLES or np.sum(forward[part]) >= limit * np.sum(length[part]):
                continue
            first, last = found.frames[strides[walk]][[0, -1]]
            swapped[inside if on_belt else _back(clip, inside, first, last)] = True
    if not swapped.any():
        return clip, []
    # All together: a short pass has few clearly bent knees.
    knees = foot_and_knee_directions(select_frames(clip, swapped))[1]
    if len(knees) < MIN_SAMPLES or np.mean(knees < 0) < MIN_FORWARD_KNEES:
        return clip, []
    text = f"seen from behind in {_named(clip, swapped)}: walks backward on knees that bend forward; "
    count, frames = int(swapped.sum()), frame_runs(swapped)
    if clip.euler is not None:
        text += "left as recorded: Euler channels cannot be swapped"
        return clip, [Defect("swapped_sides", count, "frames", "flagged", text, frames)]
    repaired = swap_sides(clip, swapped, range(len(clip.skeleton.names)), tuple(clip.angles or ()))
    feet = [joint for node, joint in joints_by_name(clip.skeleton.names).items() if node.startswith("foot")]
    # The sensor did not see the toes that it placed towards itself.
    rows = np.flatnonzero(swapped)[:, None]
    repaired.states[rows, feet] = np.minimum(repaired.states[rows, feet], INFERRED)
    text += "left and right swapped back"
    return repaired, [Defect("swapped_sides", count, "frames", "repaired", text, frames)]


def _parts(forward: Array, times: Array) -> list[tuple[slice, slice]]:
    """The parts between the turns of a walk (n,), in m/s to the front; with each, its samples without those
    before the first and after the last way to the front or to the back.
    """
    way = np.cumsum(np.append(0.0, forward * np.diff(times, prepend=times[:1]).clip(max=VELOCITY_SECONDS)))
    turns: list[int] = []
    direction = least = most = 0
    for sample in range(len(way)):
        least = sample if way[sample] < way[least] else least
        most = sample if way[sample] > way[most] else most
        if direction >= 0 and way[most] - way[sample] > MIN_WAY:
            turns.append(most)
            direction, least = -1, sample
        elif direction <= 0 and way[sample] - way[least] > MIN_WAY:
            turns.append(least)
            direction, most = 1, sample
    whole = [0, *turns[1:], len(forward)]
    ways = [*turns, least if direction < 0 else most] if turns else whole
    return list(zip(starmap(slice, pairwise(whole)), starmap(slice, pairwise(ways)), strict=True))


def _back(clip: Clip, inside: NDArray[np.intp], first: int, last: int) -> slice:
    """Frames of a pass, among those `inside`, in which the sides are changed while the person walks to their
    back from a first to a last frame; who stands longer before or after may face the sensor.
    """
    times, start, stop = clip.times[inside], int(inside[0]), int(inside[-1]) + 1
    before, after = times - clip.times[first], times - clip.times[last]
    if before[0] < -TURN_TIME:
        start = _change_of_sides(clip, inside[(before >= -TURN_TIME) & (before <= VELOCITY_SECONDS)])
    if after[-1] > TURN_TIME:
        stop = _change_of_sides(clip, inside[(after >= -VELOCITY_SECONDS) & (after <= TURN_TIME)])
    return slice(start, stop)


def _change_of_sides(clip: Clip, frames: NDArray[np.intp]) -> int:
    """The first frame with other sides: the one at which most joints come to where their counterparts were.
    A sensor may take several frames to change them.
    """
    points = nodes_of(clip)[frames]
    straight = np.linalg.norm(points[1:] - points[:-1], axis=-1)
    crossed = np.linalg.norm(points[1:] - points[:-1][:, opposite_sides(NODES)], axis=-1)
    return int(frames[1 + np.argmax(np.nansum(straight - crossed, axis=1))])


def _named(clip: Clip, frames: Mask) -> str:
    """The passes of frames (T,): "pass 1", or "passes 0, 2, part of pass 3"."""
    passes = np.unique(clip.passes[frames])
    whole = [str(number) for number in passes if frames[clip.passes == number].all()]
    parts = [f"part of pass {number}" for number in passes if str(number) not in whole]
    named = [f"{'pass' if len(whole) == 1 else 'passes'} {', '.join(whole)}"] if whole else []
    return ", ".join([*named, *parts])
