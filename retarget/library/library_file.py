"""A motion library as two files: library.json, the manifest, and library.safetensors, the arrays."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import Struct
from safetensors import SafetensorError
from safetensors.numpy import load, save

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import atomic, read_json, write_json
from kinemimic.pipeline.files.validation.bounded import MEGABYTE, read_bounded
from kinemimic.pipeline.files.validation.records import convert
from kinemimic.pipeline.files.validation.schema import upgraded
from kinemimic.retarget.formats.motion_json import UNIT_TOLERANCE
from kinemimic.retarget.humanoid.motion_check import check_motion
from kinemimic.retarget.library.motion_library import Entry, MotionLibrary

MANIFEST, ARRAYS = "library.json", "library.safetensors"
LIBRARY_SCHEMA = 1
_LIMIT = 2048 * MEGABYTE
_ADVICE = "run `library` again"


class _Manifest(Struct):
    sha256: str
    motions: list[Entry]


def write_library(folder: Path, library: MotionLibrary, described: Mapping[str, Any]) -> dict[str, Any]:
    """Write both files, the manifest last; returns its content.

    described: further keys of the manifest; a list `motions` there has further keys of each motion.
    KinemimicError for more motions than `read_library` would read.
    """
    data = save(
        {
            "root": np.ascontiguousarray(library.root),
            "rotations": np.ascontiguousarray(library.rotations),
            "contacts": np.ascontiguousarray(library.contacts),
        }
    )
    if len(data) > _LIMIT:
        raise KinemimicError(
            f"{folder / ARRAYS}: expected motions of at most {_LIMIT // MEGABYTE:,} MB, found "
            f"{len(data) // MEGABYTE:,} MB of {len(library):,} motions; make several libraries"
        )
    more = described.get("motions", [{}] * len(library))
    manifest = {
        "schema": LIBRARY_SCHEMA,
        "arrays": ARRAYS,
        "sha256": hashlib.sha256(data).hexdigest(),
        **described,
        "motions": [asdict(entry) | extra for entry, extra in zip(library.entries, more, strict=True)],
    }
    with atomic(folder / ARRAYS) as temporary:
        temporary.write_bytes(data)
    write_json(folder / MANIFEST, manifest)
    return manifest


def read_library(folder: Path) -> MotionLibrary:
    """Read the files that `write_library` wrote.

    KinemimicError for any others, for arrays of another manifest, and for invalid motions.
    """
    path, arrays = folder / MANIFEST, folder / ARRAYS
    if not path.exists():
        raise KinemimicError(
            f"{path}: expected the manifest of a motion library, found no file; run `kinemimic library` first"
        )
    document = read_json(path)
    if not isinstance(document, dict):
        raise KinemimicError(
            f"{path}: expected the manifest of a motion library, found other JSON; {_ADVICE}"
        )
    document = upgraded(document, path, kind="a motion library", schema=LIBRARY_SCHEMA, advice=_ADVICE)
    manifest: _Manifest = convert(document, _Manifest, path, advice=_ADVICE)
    try:
        data = read_bounded(arrays, _LIMIT, "the arrays of a motion library")
    except FileNotFoundError:
        raise KinemimicError(f"{arrays}: expected the arrays of {path}, found no file; {_ADVICE}") from None
    if hashlib.sha256(data).hexdigest() != manifest.sha256:
        raise KinemimicError(f"{arrays}: expected the arrays of {path}, found others; {_ADVICE}")
    try:
        tensors = load(data)
        library = MotionLibrary(
            tuple(manifest.motions), *(tensors[name] for name in ("root", "rotations", "contacts"))
        )
        for index, entry in enumerate(library.entries):
            check_motion(arrays, library.motion(index))
            _check_rotations(arrays, entry.name, library.motion(index).rotations)
    # safetensors raises any of these for number types that numpy lacks.
    except (SafetensorError, AttributeError, KeyError, TypeError, ValueError) as error:
        raise KinemimicError(f"{path}: expected a motion library, found {error}; {_ADVICE}") from None
    return library


def _check_rotations(path: Path, name: str, rotations: Array) -> None:
    lengths = np.linalg.norm(rotations, axis=-1)
    if (off := lengths[np.abs(lengths - 1.0) > UNIT_TOLERANCE]).size:
        raise KinemimicError(
            f"{path}: {name}: expected unit quaternions, found length {off[0]:.6g}; {_ADVICE}"
        )
