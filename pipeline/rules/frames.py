"""A choice of a clip's frames, all its arrays alike."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.clip import Clip


def kept(clip: Clip, mask: NDArray[np.bool_]) -> Clip:
    """The frames of a clip where mask (T,) is True, with their times."""
    return replace(
        clip,
        times=clip.times[mask],
        positions=clip.positions[mask],
        states=clip.states[mask],
        passes=clip.passes[mask],
        euler=None if clip.euler is None else clip.euler[mask],
        translations=None if clip.translations is None else clip.translations[mask],
        rotations=None if clip.rotations is None else clip.rotations[mask],
        angles=None if clip.angles is None else {name: curve[mask] for name, curve in clip.angles.items()},
    )
