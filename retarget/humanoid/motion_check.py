"""What holds for a motion from a file, whatever its format: the stages behind it take it to be in reason."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.retarget.humanoid.motion import Motion

# Frames a second. Below, a few frames last for hours, which are simulated; above, nobody records.
MIN_RATE, MAX_RATE = 1.0, 1000.0
# Metres from where the motion begins: three hours of walking. Squares of what is far beyond overflow.
MAX_DISTANCE = 1e4


def check_motion(path: Path, motion: Motion) -> Motion:
    """The motion, read from `path`; a KinemimicError names the first thing in it that is out of reason."""
    if not MIN_RATE <= motion.rate <= MAX_RATE:
        _fail(path, "fps", f"{MIN_RATE:g} to {MAX_RATE:g} frames a second", f"{motion.rate:g}")
    if len(motion.root) < 2 and not motion.cyclic:
        _fail(path, "frames", "at least 2, or 1 of a cycle", f"{len(motion.root)}")
    if motion.cycle_offset.shape != (3,):
        _fail(path, "cycle_offset", "3 numbers", f"shape {motion.cycle_offset.shape}")
    places = {"positions": motion.root, "offsets": motion.offsets, "cycle_offset": motion.cycle_offset}
    for name, array in places.items():
        if (wrong := array[~(np.abs(array) < MAX_DISTANCE)]).size:  # NaN too
            _fail(path, name, f"less than {MAX_DISTANCE:,.0f} m", f"{wrong[0]:g}")
    _check_provenance(path, motion.provenance)
    return motion


def _check_provenance(path: Path, provenance: Any) -> None:
    if not isinstance(provenance, dict):
        _fail(path, "provenance", "an object", f"{provenance!r:.40}")
    try:
        # It is written again beside what is made of the motion: no NaN, no half of a surrogate pair.
        json.dumps(provenance, allow_nan=False, ensure_ascii=False).encode()
    except (ValueError, RecursionError):
        _fail(path, "provenance", "plain JSON", "NaN, half a character, or deep nesting")
    capture = provenance.get("capture", {})
    if not isinstance(capture, Mapping):
        _fail(path, "provenance.capture", "an object", f"{capture!r:.40}")
    for key in ("source", "sha256"):
        if not isinstance(capture.get(key, ""), str):
            _fail(path, f"provenance.capture.{key}", "text", f"{capture[key]!r:.40}")


def _fail(path: Path, key: str, expected: str, found: str) -> NoReturn:
    raise KinemimicError(f"{path}: {key}: expected {expected}, found {found}; run `retarget` again")
