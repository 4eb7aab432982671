"""Validation of a motion read from a file of any format; later stages rely on these bounds."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from msgspec import Struct

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.validation.records import convert
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


class _Capture(Struct, frozen=True):
    source: str = ""
    sha256: str = ""


class _Provenance(Struct):
    capture: _Capture = _Capture()


def _check_provenance(path: Path, provenance: Any) -> None:
    try:
        # It is copied into other files: no NaN and no lone surrogates.
        json.dumps(provenance, allow_nan=False, ensure_ascii=False).encode()
    except (ValueError, RecursionError):
        _fail(path, "provenance", "plain JSON", "NaN, a lone surrogate, or deep nesting")
    convert(provenance, _Provenance, path, within=("provenance",), advice="run `retarget` again")


def _fail(path: Path, key: str, expected: str, found: str) -> NoReturn:
    raise KinemimicError(f"{path}: {key}: expected {expected}, found {found}; run `retarget` again")
