"""Detects passes in which the walker is seen from behind, and swaps left and right in them.

Kinect v1 and v2 assume that every body faces the sensor, and so swap the sides of a person who walks away.
In such passes the body seems to walk backward on knees that bend forward. (The knees of a person who really
walks backward bend the usual way.) The toes, which the sensor invents, pointing towards itself, stay in
place and are marked as inferred. Euler captures are only flagged.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.joint_names import joints_by_name
from kinemimic.pipeline.kinematics.skeleton import INFERRED
from kinemimic.pipeline.kinematics.spans import frame_runs
from kinemimic.pipeline.locomotion.striding import striding_frames
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.quality.rules.frame_selection import select_frames
from kinemimic.pipeline.quality.rules.mirrored_body import foot_and_knee_directions
from kinemimic.pipeline.quality.rules.swap_sides import swap_sides
from kinemimic.pipeline.quality.rules.turning_camera import ground_moves

# Share of the path walked in the facing direction, -1 if all of it is backward: of the hips' path over a
# floor, or of the path relative to the planted foot on a belt, where the wrong foot is sometimes chosen.
MAX_FORWARD_SHARE = -0.7
MAX_FORWARD_SHARE_ON_BELT = -0.3
# Share of the clearly bent knees that bend forward; up to 0.4 in walks towards a Kinect v1.
MIN_FORWARD_KNEES = 0.45
MIN_SAMPLES = 8


def repair(clip: Clip) -> tuple[Clip, list[Defect]]:
    """The clip with left and right swapped in the passes seen from behind."""
    found = striding_frames(clip)
    on_belt = len(found.frames) >= MIN_SAMPLES and ground_moves(found)
    velocity, limit = (
        (found.walking_velocity, MAX_FORWARD_SHARE_ON_BELT)
        if on_belt
        else (found.hip_velocity, MAX_FORWARD_SHARE)
    )
    backward: list[int] = []
    for number in range(int(clip.passes.max(initial=-1)) + 1):
        in_pass = clip.passes[found.frames] == number
        length = np.linalg.norm(velocity[in_pass], axis=1).sum()
        if (
            in_pass.sum() >= MIN_SAMPLES
            and np.sum(velocity[in_pass] * found.forward[in_pass]) < limit * length
        ):
            backward.append(number)
    if not backward:
        return clip, []
    swapped = np.isin(clip.passes, backward)
    # All passes together: a short pass has few clearly bent knees.
    knees = foot_and_knee_directions(select_frames(clip, swapped))[1]
    if len(knees) < MIN_SAMPLES or np.mean(knees < 0) < MIN_FORWARD_KNEES:
        return clip, []
    numbers = ", ".join(map(str, backward))
    passes = "pass" if len(backward) == 1 else "passes"
    text = f"seen from behind in {passes} {numbers}: walks backward on knees that bend forward; "
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
