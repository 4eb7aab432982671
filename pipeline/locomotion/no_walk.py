"""Why a capture with regular steps has no bout of walking."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.locomotion.bouts import spans_of_pass
from kinemimic.pipeline.locomotion.leg_pose import is_precise, leg_bones
from kinemimic.pipeline.locomotion.pass_gait import gait_of_pass
from kinemimic.pipeline.locomotion.walk_rule import MIN_STRIDES

OTHER_PATH = "the body's path does not match its steps"
BACKWARD_IN_PLACE = "they go backward, and the body stays in its place"


def why_no_walk(times: Array, passes: NDArray[np.int32], positions: Array, *, toes: bool = True) -> str:
    """Number of regular strides of a capture without a bout (`find_bouts`), and why they are not a walk.

    "" if it has fewer than a bout needs. Arguments as for `find_bouts`.
    """
    lengths = leg_bones(positions)
    if not np.isfinite(lengths).any(axis=0).all():
        return ""
    bones = np.nanmedian(lengths, axis=0)
    precise = is_precise(positions)
    cycles: defaultdict[str, float] = defaultdict(float)
    for number in np.unique(passes[passes >= 0]).tolist():
        frames = passes == number
        for reason, count in _reasons(times[frames], positions[frames], bones, precise=precise, toes=toes):
            cycles[reason] += count
    if not cycles:
        return ""
    reason = max(cycles, key=lambda one: cycles[one])
    count = cycles[reason]
    return f"{count:.1f} strides, but no walk: {reason}" if count >= MIN_STRIDES else ""


def _reasons(
    times: Array, positions: Array, bones: Array, *, precise: bool, toes: bool
) -> list[tuple[str, float]]:
    """Reasons and numbers of the regular strides of one pass: times (T,), positions (T, 20, 3)."""
    gait = gait_of_pass(times, positions)
    if gait is None:
        return []
    found = [(stride.why, stride.cycles) for stride in gait.strides(precise=precise) if stride.why]
    for span in spans_of_pass(times, positions, bones, precise=precise, toes=toes):
        cycles = sum(stride.cycles for stride in span.strides)
        if cycles < MIN_STRIDES:
            continue
        source = span.path.source
        if source == "neither" or (source == "feet" and precise and span.feet.backward):
            found.append((OTHER_PATH if source == "neither" else BACKWARD_IN_PLACE, cycles))
    return found
