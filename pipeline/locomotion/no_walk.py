"""Why a capture with regular steps has no bout of walking."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.body_points import place
from kinemimic.pipeline.kinematics.spans import runs
from kinemimic.pipeline.locomotion.even_clock import RATE
from kinemimic.pipeline.locomotion.leg_pose import is_precise
from kinemimic.pipeline.locomotion.pass_gait import gait_of_pass
from kinemimic.pipeline.locomotion.path.ground_path import choose_path, disagreements
from kinemimic.pipeline.locomotion.path.odometry import foot_odometry
from kinemimic.pipeline.locomotion.phase.frames import frames_between
from kinemimic.pipeline.locomotion.walk_rule import MIN_STRIDES

OTHER_PATH = "the body's path does not match its steps"
BACKWARD_IN_PLACE = "they go backward, and the body stays in its place"


def why_no_walk(times: Array, passes: NDArray[np.int32], positions: Array, *, toes: bool = True) -> str:
    """Number of regular strides of a capture without a bout (`find_bouts`), and why they are not a walk.

    "" if it has fewer than a bout needs. Arguments as for `find_bouts`.
    """
    precise = is_precise(positions)
    cycles: defaultdict[str, float] = defaultdict(float)
    for number in np.unique(passes[passes >= 0]).tolist():
        frames = passes == number
        for reason, count in _reasons(times[frames], positions[frames], precise=precise, toes=toes):
            cycles[reason] += count
    if not cycles:
        return ""
    reason = max(cycles, key=lambda one: cycles[one])
    count = cycles[reason]
    return f"{count:.1f} strides, but no walk: {reason}" if count >= MIN_STRIDES else ""


def _reasons(times: Array, positions: Array, *, precise: bool, toes: bool) -> list[tuple[str, float]]:
    """Reasons and numbers of the regular strides of one pass: times (T,), positions (T, 20, 3)."""
    gait = gait_of_pass(times, positions)
    if gait is None:
        return []
    strides = gait.strides(precise=precise)
    found = [(stride.why, stride.cycles) for stride in strides if stride.why]
    root = place(gait.even.positions, "hips")
    for part in runs(np.array([stride.walking for stride in strides], dtype=np.bool_)):
        mine = strides[part]
        if mine[-1].end - mine[0].start < MIN_STRIDES:
            continue
        inside = frames_between(gait.phase, mine[0].start, mine[-1].end)
        positions, phase = gait.even.positions[inside], gait.phase[inside]
        feet = foot_odometry(positions, gait.heading[inside], phase, RATE, toes=precise and toes)
        edges = np.array([(stride.start, stride.end) for stride in mine])
        apart = disagreements(root[inside], feet, phase, edges, RATE)
        source = choose_path(root[inside], feet, apart, RATE, precise=precise).source
        if source == "neither" or (source == "feet" and precise and feet.backward):
            why = OTHER_PATH if source == "neither" else BACKWARD_IN_PLACE
            found.append((why, sum(stride.cycles for stride in mine)))
    return found
