"""The bouts of walking of a clip."""

from __future__ import annotations

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.locomotion.bouts import Bout, find_bouts


def bouts_of(clip: Clip) -> list[Bout]:
    """The bouts of a clip on the 20 nodes."""
    return find_bouts(clip.times, clip.passes, clip.positions)
