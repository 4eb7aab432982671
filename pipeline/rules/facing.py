"""Passes in which the walker is seen from behind.

A Kinect takes every body to face it, and so exchanges the sides of one that walks away. In such a pass the
body walks to where its back seems to be, and its knees bend forward. (Who really walks backward has knees
that bend backward as ever.) All left and right joints change names then. The toes, which the tracker invents
towards itself, stay where it put them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kinemimic.pipeline.clip import Clip
from kinemimic.pipeline.defect import Defect
from kinemimic.pipeline.nodes import normalised
from kinemimic.pipeline.rules.camera import carried
from kinemimic.pipeline.rules.frames import kept
from kinemimic.pipeline.rules.gait import steps
from kinemimic.pipeline.rules.mirror import votes
from kinemimic.pipeline.rules.runs import frame_runs

# Share of the way that goes to where the body faces, -1 where all of it goes backward: of the hips' way over
# a floor; or of the way over the planted foot on a belt, where now and then the wrong foot is taken for that.
BACKWARD = -0.7
BACKWARD_ON_BELT = -0.3
# Share of the clear knees that bend forward; walks towards a Kinect v1 have up to 0.4 of those.
FORWARD_KNEES = 0.45
ENOUGH = 8


def check(clip: Clip) -> tuple[Clip, list[Defect]]:
    """The clip with both sides exchanged in such passes; Euler captures are only flagged."""
    found = steps(clip)
    on_belt = len(found.frames) >= ENOUGH and carried(found)
    way, limit = (found.walk, BACKWARD_ON_BELT) if on_belt else (found.hips, BACKWARD)
    wrong: list[int] = []
    for number in range(int(clip.passes.max(initial=-1)) + 1):
        mine = clip.passes[found.frames] == number
        length = np.linalg.norm(way[mine], axis=1).sum()
        if mine.sum() < ENOUGH or np.sum(way[mine] * found.forward[mine]) > limit * length:
            continue
        knees = votes(kept(clip, clip.passes == number))[1]
        if len(knees) >= ENOUGH and np.mean(knees < 0) >= FORWARD_KNEES:
            wrong.append(number)
    if not wrong:
        return clip, []
    where = np.isin(clip.passes, wrong)
    plural = "es" if len(wrong) > 1 else ""
    numbers = ", ".join(map(str, wrong))
    text = f"seen from behind in pass{plural} {numbers}: walks backward on knees that bend forward; "
    count, frames = int(where.sum()), frame_runs(where)
    if clip.euler is not None:
        text += "left as recorded: Euler channels cannot be exchanged"
        return clip, [Defect("swapped_sides", count, "frames", "flagged", text, frames)]
    other = _other_side(clip.skeleton.names)
    positions, states = clip.positions.copy(), clip.states.copy()
    positions[where], states[where] = positions[where][:, other], states[where][:, other]
    rotations = clip.rotations
    if rotations is not None:
        # They were found for a body that looks the other way: no exchange makes them this one's.
        rotations = rotations.copy()
        rotations[where] = np.nan
    text += "both sides exchanged there"
    repaired = replace(clip, positions=positions, states=states, rotations=rotations)
    return repaired, [Defect("swapped_sides", count, "frames", "repaired", text, frames)]


def _other_side(names: tuple[str, ...]) -> list[int]:
    """Index (J,) of each joint's counterpart; a joint of the middle is its own."""
    index = {normalised(name): joint for joint, name in enumerate(names)}
    other: list[int] = []
    for joint, name in enumerate(names):
        plain = normalised(name)
        swap = plain.replace("left", "#").replace("right", "left").replace("#", "right")
        other.append(index.get(swap, joint))
    return other
