"""Validation of a motion read from a file of any format; later stages rely on these bounds."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.retarget.humanoid.motion import Motion

# Frames per second. Below, a few frames would take hours to simulate; above, no device records.
MIN_RATE, MAX_RATE = 1.0, 1000.0
# Metres from the start: three hours of walking. Squares of much larger numbers overflow.
MAX_DISTANCE = 1e4


def check_motion(path: Path, motion: Motion) -> Motion:
    """The motion, read from `path`; a KinemimicError names the first value out of bounds."""
    if not MIN_RATE <= motion.rate <= MAX_RATE:
        _fail(path, "fps", f"{MIN_RATE:g} to {MAX_RATE:g} frames a second", f"{motion.rate:g}")
    if len(motion.root) < 2 and not motion.cyclic:
        _fail(path, "frames", "at least 2 (1 in a cycle)", f"{len(motion.root)}")
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
        # It is copied into other files: no NaN and no lone surrogates.
        json.dumps(provenance, allow_nan=False, ensure_ascii=False).encode()
    except (ValueError, RecursionError):
        _fail(path, "provenance", "plain JSON", "NaN, a lone surrogate, or deep nesting")
    capture = provenance.get("capture", {})
    if not isinstance(capture, Mapping):
        _fail(path, "provenance.capture", "an object", f"{capture!r:.40}")
    for key in ("source", "sha256"):
        if not isinstance(capture.get(key, ""), str):
            _fail(path, f"provenance.capture.{key}", "text", f"{capture[key]!r:.40}")


def _fail(path: Path, key: str, expected: str, found: str) -> NoReturn:
    raise KinemimicError(f"{path}: {key}: expected {expected}, found {found}; run `retarget` again")
