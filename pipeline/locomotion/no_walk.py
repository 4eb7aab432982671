"""Why a capture with regular steps has no bout of walking."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.spans import runs
from kinemimic.pipeline.locomotion.even_clock import RATE, even_pass
from kinemimic.pipeline.locomotion.heading import ankle_distance, body_heading
from kinemimic.pipeline.locomotion.leg_pose import is_precise
from kinemimic.pipeline.locomotion.odometry import choose_path, disagreements, foot_odometry
from kinemimic.pipeline.locomotion.stride_phase import gait_phase
from kinemimic.pipeline.locomotion.strides import cut_strides
from kinemimic.pipeline.locomotion.walk_rule import MIN_STRIDES

OTHER_PATH = "the body's path does not match its steps"


def why_no_walk(times: Array, passes: NDArray[np.int32], positions: Array) -> str:
    """Number of regular strides of a capture in which `find_bouts` finds no bout, and why they are no walk.

    "" if it has fewer than a bout needs. Arguments as of `find_bouts`.
    """
    precise = is_precise(positions)
    cycles: defaultdict[str, float] = defaultdict(float)
    for number in np.unique(passes[passes >= 0]).tolist():
        frames = passes == number
        for reason, count in _reasons(times[frames], positions[frames], precise=precise):
            cycles[reason] += count
    if not cycles:
        return ""
    reason = max(cycles, key=lambda one: cycles[one])
    count = cycles[reason]
    return f"{count:.1f} strides, but no walk: {reason}" if count >= MIN_STRIDES else ""


def _reasons(times: Array, positions: Array, *, precise: bool) -> list[tuple[str, float]]:
    """Reasons and numbers of the regular strides of one pass: times (T,), positions (T, 20, 3)."""
    even = even_pass(times, positions)
    if even is None:
        return []
    heading, facing = body_heading(even.positions, RATE)
    *_, apart = ankle_distance(even.positions, even.seen, heading)
    phase = gait_phase(even.times, apart)
    if phase is None:
        return []
    strides = cut_strides(even.times, even.positions, heading, phase, facing=facing if precise else None)
    found = [(stride.why, stride.cycles) for stride in strides if stride.why]
    root = 0.5 * (even.positions[:, N["hip_left"]] + even.positions[:, N["hip_right"]])
    for part in runs(np.array([stride.walking for stride in strides], dtype=np.bool_)):
        mine = strides[part]
        inside = slice(*np.searchsorted(phase, (mine[0].start, mine[-1].end)))
        if mine[-1].end - mine[0].start < MIN_STRIDES:
            continue
        feet = foot_odometry(even.positions[inside], heading[inside], phase[inside], RATE, toes=precise)
        edges = np.array([(stride.start, stride.end) for stride in mine])
        apart = disagreements(root[inside], feet, phase[inside], edges, RATE)
        if choose_path(root[inside], feet, apart, RATE, precise=precise).source == "neither":
            found.append((OTHER_PATH, sum(stride.cycles for stride in mine)))
    return found
