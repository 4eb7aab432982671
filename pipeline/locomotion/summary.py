"""A capture's gait in a few numbers, as `inspect` reports it: what `retarget` will use."""

from __future__ import annotations

from typing import Any

import numpy as np

from kinemimic.pipeline.files.json_layout import rounded
from kinemimic.pipeline.locomotion.bouts import Bout
from kinemimic.pipeline.locomotion.walk_rule import MIN_SPEED


def gait_summary(bouts: list[Bout]) -> dict[str, Any] | None:
    """Period (s), cadence (steps per minute), speed (m/s), strides and source of the path; None without a
    bout.

    Medians over the strides of walking; speed is the mean over the bouts, whether forward or backward, and
    None on the spot; r2 is that of one harmonic of the ankles' distance within a stride.
    """
    if not bouts:
        return None
    strides = [stride for bout in bouts for stride in bout.strides if stride.walking]
    period = float(np.median([stride.period for stride in strides]))
    speed = float(np.average([abs(one.speed) for one in bouts], weights=[one.cycles for one in bouts]))
    return {
        "period_s": rounded(period, 3),
        "cadence_steps_min": rounded(120.0 / period, 1),
        "speed_m_s": rounded(speed, 3) if speed > MIN_SPEED else None,
        "r2": rounded(float(np.median([stride.r2 for stride in strides])), 3),
        "bouts": len(bouts),
        "strides": rounded(sum(one.cycles for one in bouts), 1),
        "strides_usable": rounded(sum(one.used_strides for one in bouts), 1),
        "path": "feet" if any(one.path.source == "feet" for one in bouts) else "recorded",
    }
