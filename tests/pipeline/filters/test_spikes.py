"""Spikes are removed, fast motion is kept."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kinemimic.pipeline.filters.spikes import despike
from kinemimic.pipeline.kinematics.clip import Clip

Build = Callable[..., Clip]


def test_spikes_go_and_fast_motion_stays(node_clip: Build) -> None:
    """A spike becomes the median of five frames: no farther from the truth than a node moves in two frames,
    and the median of the five places on either side."""
    clip = node_clip(90)
    clean_positions = clip.positions + np.array([4.0, 0, 0]) * clip.times[:, None, None]
    spiky = clean_positions.copy()
    spiky[30, 7] += [0.0, 0.2, 0.0]
    spiky[50:52, 9] += [0.1, 0.0, 0.1]
    out, spikes = despike(spiky, clip.passes)
    assert {tuple(map(int, at)) for at in np.argwhere(spikes)} == {(30, 7), (50, 9), (51, 9)}
    np.testing.assert_allclose(out[30, 7], np.median(spiky[28:33, 7], axis=0), atol=1e-12)
    for frame in (50, 51):
        np.testing.assert_allclose(
            out[frame, 9], np.median(spiky[frame - 2 : frame + 3, 9], axis=0), atol=1e-12
        )
    travel = np.linalg.norm(clean_positions[2:] - clean_positions[:-2], axis=-1).max()
    off = np.linalg.norm(out - clean_positions, axis=-1)
    assert off.max() <= travel
    assert np.array_equal(out[~spikes], spiky[~spikes])
    assert not despike(clean_positions, clip.passes)[1].any()
