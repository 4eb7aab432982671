"""Walkers whose legs differ, and a path that climbs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N


def with_weak_leg(clip: Clip, share: float) -> Clip:
    """A walk along +X whose right thigh and shank swing through a share of their angles; the body goes on."""
    p = clip.positions.copy()
    at = p[:, N["hip_right"]]
    for start, end in (
        ("hip_right", "knee_right"),
        ("knee_right", "ankle_right"),
        ("ankle_right", "foot_right"),
    ):
        bone = clip.positions[:, N[end]] - clip.positions[:, N[start]]
        if end != "foot_right":
            length = np.hypot(bone[:, 0], bone[:, 2])
            angle = share * np.arctan2(bone[:, 0], -bone[:, 2])
            bone = np.stack([length * np.sin(angle), bone[:, 1], -length * np.cos(angle)], axis=1)
        at = at + bone
        p[:, N[end]] = at
    return replace(clip, positions=p)


def on_a_ramp(clip: Clip, degrees: float) -> Clip:
    """A walk along +X whose path climbs; the poses stay."""
    p = clip.positions.copy()
    way = 0.5 * (p[:, [N["hip_left"]], 0] + p[:, [N["hip_right"]], 0])
    p[..., 2] += np.tan(np.radians(degrees)) * (way - way[0])
    return replace(clip, positions=p)
