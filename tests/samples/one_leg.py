"""People one of whose legs always leads, without a truth: kicks, lunges, and steps to the other foot."""

from __future__ import annotations

from typing import Literal

import numpy as np

from kinemimic.pipeline.kinematics.clip import Clip, forward_kinematics
from kinemimic.pipeline.kinematics.rotations import IDENTITY, from_axis_angle, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import node_skeleton
from kinemimic.retarget.humanoid.body import node_offsets
from samples.walker import clip_of_nodes

_SIZE, _LEG = 1.1, 0.9  # of the person; m from the hip to the ankle


def one_leg_leads(
    kind: Literal["kick", "lunge", "step-to"],
    rate: float,
    period: float,
    *,
    seconds: float = 9.0,
    noise: float = 0.015,
    heading: float = 0.0,
    seed: int = 0,
) -> Clip:
    """Repetitions with the right leg at the rate (Hz), each for a period (s).

    "kick": the right leg swings forward and comes back, and the hips stay. "lunge": it steps forward, and
    back. "step-to": it steps forward, and the left foot comes beside it. noise: m; heading: radians.
    """
    t = np.arange(round(seconds * rate)) / rate
    out = 0.5 - 0.5 * np.cos(2.0 * np.pi * t / period)  # 0: the feet are together
    angle = np.radians(25.0) * out
    legs = {"left": -angle, "right": angle}
    planted = -_LEG * np.sin(legs["left"])
    if kind == "kick":
        legs, planted = {"left": 0.0 * t, "right": 2.0 * angle}, 0.0 * t
    elif kind == "step-to":
        # While the feet part, over the left one; while they come together, over the right one.
        planted = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(planted)))])
    knee = np.radians(10.0) + np.radians(25.0) * out
    skeleton = node_skeleton(_SIZE * node_offsets())
    q = np.tile(IDENTITY, (len(t), len(skeleton.names), 1))
    for side, hip in legs.items():
        q[:, N[f"hip_{side}"]] = from_axis_angle("Y", -hip - 0.5 * knee)
        q[:, N[f"knee_{side}"]] = from_axis_angle("Y", knee)
    places = np.broadcast_to(skeleton.offsets, (len(t), len(skeleton.names), 3)).copy()
    places[:, 0] = np.stack([planted, 0.0 * t, np.full(len(t), 0.95 * _SIZE)], axis=-1)
    p, _ = forward_kinematics(skeleton, places, q)
    p = rotate(from_axis_angle("Z", heading), p)
    p += noise * np.random.default_rng(seed).standard_normal(p.shape)
    return clip_of_nodes(t, p)
