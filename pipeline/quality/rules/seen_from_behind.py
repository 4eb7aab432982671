"""Passes in which the walker is seen from behind.

A Kinect, v1 or v2, takes every body to face it, and so exchanges the sides of one that walks away. In such
passes the body walks to where its back seems to be, and its knees bend forward. (Who really walks backward
has knees that bend backward as ever.) All left and right joints change names then. The toes, which the
tracker invents towards itself, stay where it put them, as inferred.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.gait.walking import striding_frames
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import joints_of_nodes
from kinemimic.pipeline.kinematics.skeleton import INFERRED
from kinemimic.pipeline.kinematics.spans import frame_runs
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.quality.rules.frame_selection import select_frames
from kinemimic.pipeline.quality.rules.mirrored_body import votes
from kinemimic.pipeline.quality.rules.swap_sides import swap_sides
from kinemimic.pipeline.quality.rules.turning_camera import ground_moves

# Share of the way that goes to where the body faces, -1 where all of it goes backward: of the hips' way over
# a floor; or of the way over the planted foot on a belt, where now and then the wrong foot is taken for that.
BACKWARD = -0.7
BACKWARD_ON_BELT = -0.3
# Share of the clear knees that bend forward; walks towards a Kinect v1 have up to 0.4 of those.
FORWARD_KNEES = 0.45
ENOUGH = 8


def repair(clip: Clip) -> tuple[Clip, list[Defect]]:
    """The clip with both sides exchanged in such passes; Euler captures are only flagged."""
    found = striding_frames(clip)
    on_belt = len(found.frames) >= ENOUGH and ground_moves(found)
    way, limit = (found.walking_velocity, BACKWARD_ON_BELT) if on_belt else (found.hip_velocity, BACKWARD)
    backward: list[int] = []
    for number in range(int(clip.passes.max(initial=-1)) + 1):
        mine = clip.passes[found.frames] == number
        length = np.linalg.norm(way[mine], axis=1).sum()
        if mine.sum() >= ENOUGH and np.sum(way[mine] * found.forward[mine]) < limit * length:
            backward.append(number)
    if not backward:
        return clip, []
    where = np.isin(clip.passes, backward)
    # Judged together: one short pass has few clear knees, and who turns round does so in all of them.
    knees = votes(select_frames(clip, where))[1]
    if len(knees) < ENOUGH or np.mean(knees < 0) < FORWARD_KNEES:
        return clip, []
    plural = "es" if len(backward) > 1 else ""
    numbers = ", ".join(map(str, backward))
    text = f"seen from behind in pass{plural} {numbers}: walks backward on knees that bend forward; "
    count, frames = int(where.sum()), frame_runs(where)
    if clip.euler is not None:
        text += "left as recorded: Euler channels cannot be exchanged"
        return clip, [Defect("swapped_sides", count, "frames", "flagged", text, frames)]
    repaired = swap_sides(clip, where, range(len(clip.skeleton.names)), tuple(clip.angles or ()))
    feet = [joint for node, joint in joints_of_nodes(clip.skeleton.names).items() if node.startswith("foot")]
    # Toes that point to the sensor were not seen.
    rows = np.flatnonzero(where)[:, None]
    repaired.states[rows, feet] = np.minimum(repaired.states[rows, feet], INFERRED)
    text += "both sides exchanged there"
    return repaired, [Defect("swapped_sides", count, "frames", "repaired", text, frames)]
