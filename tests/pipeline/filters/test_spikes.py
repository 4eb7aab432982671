"""Spikes are removed, fast motion is kept."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kinemimic.pipeline.filters.spikes import despike
from kinemimic.pipeline.kinematics.clip import Clip

Build = Callable[..., Clip]


def test_spikes_go_and_fast_motion_stays(node_clip: Build) -> None:
    clip = node_clip(90)
    clean_positions = clip.positions + np.array([4.0, 0, 0]) * clip.times[:, None, None]
    spiky = clean_positions.copy()
    spiky[30, 7] += [0.0, 0.2, 0.0]
    spiky[50:52, 9] += [0.1, 0.0, 0.1]
    out, spikes = despike(spiky, clip.passes)
    assert {tuple(map(int, at)) for at in np.argwhere(spikes)} == {(30, 7), (50, 9), (51, 9)}
    assert np.linalg.norm(out - clean_positions, axis=-1).max() < 0.3
    assert np.array_equal(out[~spikes], spiky[~spikes])
    assert not despike(clean_positions, clip.passes)[1].any()
