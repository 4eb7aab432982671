"""The frame rate that the user gives: it replaces the file's clock before any rule looks at the capture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.clip import Clip

# In Hz.
LOWEST, HIGHEST = 1.0, 1000.0


def at_rate(clip: Clip, rate: float) -> Clip:
    """The clip with its clock scaled so that the median step is 1 / rate; labels move with their frames.

    Dropped frames and jitter keep their share of a step. The clip starts at the same time. The reading
    records "rate_hz" and a note; what the reader found about the clock no longer holds. KinemimicError for a
    rate outside LOWEST to HIGHEST.
    """
    if not LOWEST <= rate <= HIGHEST:
        raise KinemimicError(f"expected a frame rate of {LOWEST:g} to {HIGHEST:g} Hz, found {rate:g}")
    if len(clip.times) < 2:
        return clip
    start, factor = float(clip.times[0]), clip.rate / rate
    times = start + np.arange(len(clip.times)) / rate
    if not np.allclose(np.diff(clip.times) * clip.rate, 1.0, atol=1e-6):
        times = start + (clip.times - start) * factor
    labels = tuple(
        replace(label, start=start + (label.start - start) * factor, end=start + (label.end - start) * factor)
        for label in clip.labels
    )
    reading = {key: value for key, value in clip.provenance["reading"].items() if key != "assumed_rate"}
    note = f"{rate:g} frames per second, set by --rate; by the file's clock {clip.rate:.4g}"
    reading |= {
        "rate_hz": rate,
        "notes": [*reading["notes"], note],
        "defects": [defect for defect in reading["defects"] if defect["rule"] != "wrong_rate"],
    }
    return replace(clip, times=times, labels=labels, provenance={**clip.provenance, "reading": reading})
