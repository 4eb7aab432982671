"""Select or empty frames of a clip, and renumber the frames in defects accordingly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Mask
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import MISSING
from kinemimic.pipeline.quality.rules.defect import Defect


def select_frames(clip: Clip, frames: Mask | NDArray[np.intp]) -> Clip:
    """The clip with only the frames of a mask (T,) or of indices; they keep their times."""
    return replace(
        clip,
        times=clip.times[frames],
        positions=clip.positions[frames],
        states=clip.states[frames],
        passes=clip.passes[frames],
        euler=None if clip.euler is None else clip.euler[frames],
        translations=None if clip.translations is None else clip.translations[frames],
        rotations=None if clip.rotations is None else clip.rotations[frames],
        angles=None if clip.angles is None else {name: curve[frames] for name, curve in clip.angles.items()},
    )


def empty_frames(clip: Clip, frames: Mask) -> Clip:
    """The clip with every joint missing in the frames of a mask (T,); not for captures of Euler channels."""
    positions, states, rotations = clip.positions.copy(), clip.states.copy(), clip.rotations
    positions[frames], states[frames] = np.nan, MISSING
    if rotations is not None:
        rotations = rotations.copy()
        rotations[frames] = np.nan
    return replace(clip, positions=positions, states=states, rotations=rotations)


def renumber_defects(defects: Sequence[Defect], mask: Mask) -> list[Defect]:
    """The defects with their frames renumbered after a selection by mask (T,)."""
    before = np.concatenate([[0], np.cumsum(mask)])  # number of selected frames before each frame
    return [
        replace(
            defect,
            frames=tuple(
                (int(before[first]), int(before[last + 1]) - 1)
                for first, last in defect.frames
                if before[last + 1] > before[first]
            ),
        )
        for defect in defects
    ]
