"""A joint that leaves its way for one frame and is back in the next: no limb does that."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kinemimic.pipeline.clip import Clip
from kinemimic.pipeline.defect import Defect
from kinemimic.pipeline.rules.body import beside_the_body
from kinemimic.pipeline.rules.runs import frame_runs
from kinemimic.pipeline.skeleton import MISSING

# Off the line between the frames around it by more than this (metres), which is beyond a Kinect's noise …
NOISE = 0.10
# … and by more than the greatest acceleration of a hand or foot (m/s²) explains in that time; a kick or a
# throw has some 200 at its sharpest, a stride less than 60.
ACCELERATION = 200.0
# The places around it, less the way that the whole body went, are nearer to each other than this share of the
# jump; for a joint that moves on to another place they are two of them apart.
BACK = 1.0


def check(clip: Clip) -> tuple[Clip, list[Defect]]:
    """The clip with such places missing, so that cleaning fills them; Euler captures are only flagged."""
    if len(clip.times) < 3:
        return clip, []
    before, there, after = clip.positions[:-2], clip.positions[1:-1], clip.positions[2:]
    steps = np.diff(clip.times)
    share = (steps[:-1] / (steps[:-1] + steps[1:]))[:, None, None]
    off = np.linalg.norm(there - (before + share * (after - before)), axis=-1)
    apart = np.linalg.norm(beside_the_body(after - before), axis=-1)
    limit = np.maximum(NOISE, 0.5 * ACCELERATION * steps[:-1] * steps[1:])[:, None]
    within = (clip.passes[:-2] == clip.passes[2:]) & (clip.passes[1:-1] == clip.passes[2:])
    within &= clip.passes[1:-1] >= 0
    jumps = np.zeros(clip.states.shape, dtype=np.bool_)
    with np.errstate(invalid="ignore"):
        jumps[1:-1] = within[:, None] & (off > limit) & (apart < BACK * off)
    # A neighbour of a greater jump is off its line only because of that one.
    size = np.zeros(clip.states.shape)
    size[1:-1] = np.where(jumps[1:-1], off, 0.0)
    jumps[1:] &= size[1:] >= size[:-1]
    jumps[:-1] &= size[:-1] >= size[1:]
    count = int(jumps.sum())
    if not count:
        return clip, []
    per_joint = jumps.sum(axis=0)
    worst = np.argsort(-per_joint, kind="stable")[:3]
    names = ", ".join(f"{clip.skeleton.names[j]} {per_joint[j]}" for j in worst if per_joint[j])
    largest = float(size[jumps].max())
    text = f"{count} joint positions jump for one frame, up to {largest:.2f} m (most: {names}); "
    frames = frame_runs(np.asarray(jumps.any(axis=1)))
    if clip.euler is not None:
        text += "left as recorded: Euler channels cannot be filled"
        return clip, [Defect("jumps", count, "joint positions", "flagged", text, frames)]
    positions, states = clip.positions.copy(), clip.states.copy()
    positions[jumps], states[jumps] = np.nan, MISSING
    text += "taken out, so that they are filled"
    return replace(clip, positions=positions, states=states), [
        Defect("jumps", count, "joint positions", "repaired", text, frames)
    ]
