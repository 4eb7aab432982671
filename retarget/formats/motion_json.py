"""Motions as JSON, grouped by the skeletal layers of the paper's Fig. 4."""

from __future__ import annotations

from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.json_layout import layout
from kinemimic.pipeline.files.store import JSON_LIMIT, read_json
from kinemimic.pipeline.files.validation.bounded import MEGABYTE
from kinemimic.pipeline.files.validation.schema import upgraded
from kinemimic.pipeline.kinematics.skeleton import LAYERS, NODE_INDEX, NODE_PARENTS, NODES, SIDES
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.humanoid.motion_check import check_motion

T = TypeVar("T")

MOTION = "motion.json"  # in a run folder
MOTION_FORMAT = "kinemimic.motion"
MOTION_SCHEMA = 1
# Nanometres and nanoradians: far below any sensor's resolution, and readable.
DECIMALS = 9
UNIT_TOLERANCE = 1e-6
_CONVENTIONS = {
    "length": "metre",
    "time": "second",
    "axes": "right-handed: x forward, y left, z up; the ground is z = 0",
    "rotation": "unit quaternion (x, y, z, w), child to parent; the root's is in the world",
    "rest": "identity rotations: standing upright, arms hanging, facing x",
}


def motion_to_json(motion: Motion) -> str:
    """A motion as JSON text, deterministic.

    Numbers are rounded to DECIMALS; `read_motion_json` reads exactly the numbers written. KinemimicError for
    a motion that it could not read, because it is too long.
    """
    layers = {
        layer: {
            node: {
                "parent": _parent_name(node),
                "offset": _rounded(motion.offsets[NODE_INDEX[node]]),
                "rotations": _rounded(motion.rotations[:, NODE_INDEX[node]]),
            }
            for node in nodes
        }
        for layer, nodes in LAYERS.items()
    }
    document = {
        "format": MOTION_FORMAT,
        "schema": MOTION_SCHEMA,
        "conventions": _CONVENTIONS,
        "fps": float(motion.rate),
        "frames": len(motion.root),
        "cyclic": bool(motion.cyclic),
        "cycle_offset": _rounded(motion.cycle_offset),
        "simulated_capture": motion.simulated,
        "provenance": motion.provenance,
        "root": {"node": NODES[0], "positions": _rounded(motion.root)},
        "contacts": {side: motion.contacts[:, k].astype(int).tolist() for k, side in enumerate(SIDES)},
        "layers": layers,
    }
    text = layout(document) + "\n"
    if len(text) > JSON_LIMIT:
        frames = len(motion.root)
        most = frames * JSON_LIMIT // len(text)
        raise KinemimicError(
            f"expected a motion of at most {most:,} frames ({JSON_LIMIT // MEGABYTE} MB of JSON), found "
            f"{frames:,}, {frames / motion.rate / 60:.0f} min; take a part of the capture "
            "(`kinemimic retarget --segment`)"
        )
    return text


def read_motion_json(path: Path) -> Motion:
    """Read a file of `motion_to_json`; a KinemimicError names the first fault."""
    content = read_json(path)
    if not isinstance(content, dict):
        kind = "a list" if isinstance(content, list) else "a single value"
        raise KinemimicError(f"{path}: expected a motion (an object in JSON), found {kind}; run `retarget`")
    document = _CheckedDocument(path, content)
    document.expect("format", MOTION_FORMAT)
    advice = "run `retarget` with this version"
    document = _CheckedDocument(
        path, upgraded(document.document, path, kind="a motion", schema=MOTION_SCHEMA, advice=advice)
    )
    frames = document.value("frames", int)
    rate = document.value("fps", float)
    if frames < 1:
        raise KinemimicError(f"{path}: expected frames above zero, found {frames}")
    # Read first, so that a wrong number of frames is found before arrays are allocated.
    root = document.array("root.positions", (frames, 3))
    rotations, offsets = np.empty((frames, len(NODES), 4)), np.empty((len(NODES), 3))
    for layer, nodes in LAYERS.items():
        for node in nodes:
            place, index = f"layers.{layer}.{node}", NODE_INDEX[node]
            document.expect(f"{place}.parent", _parent_name(node))
            offsets[index] = document.array(f"{place}.offset", (3,))
            rotations[:, index] = document.array(f"{place}.rotations", (frames, 4))
            lengths = np.linalg.norm(rotations[:, index], axis=-1)
            if (off := np.flatnonzero(np.abs(lengths - 1.0) > UNIT_TOLERANCE)).size:
                raise KinemimicError(
                    f"{path}: {place}.rotations, frame {off[0]}: expected a unit quaternion, "
                    f"found length {lengths[off[0]]:.6g}"
                )
    motion = Motion(
        rate=rate,
        root=root,
        rotations=rotations,
        contacts=np.stack([document.array(f"contacts.{side}", (frames,)) for side in SIDES], axis=-1).astype(
            bool
        ),
        cyclic=document.value("cyclic", bool),
        cycle_offset=document.array("cycle_offset", (3,)),
        offsets=offsets,
        provenance=document.value("provenance", dict),
    )
    return check_motion(path, motion)


_LARGEST = 1e9  # far beyond metres, radians and counts; squares of it do not overflow


class _CheckedDocument:
    """A JSON document whose values are fetched by dotted path and checked."""

    def __init__(self, path: Path, document: Any) -> None:
        self.path, self.document = path, document

    def fetch(self, place: str) -> Any:
        found = self.document
        for key in place.split("."):
            if not isinstance(found, dict) or key not in found:
                raise KinemimicError(
                    f"{self.path}: expected the key {place!r}, found no {key!r}; run `retarget`"
                )
            found = found[key]
        return found

    def expect(self, place: str, wanted: Any) -> None:
        if (found := self.fetch(place)) != wanted:
            raise KinemimicError(f"{self.path}: {place}: expected {wanted!r}, found {found!r:.40}")

    def value(self, place: str, kind: type[T]) -> T:
        found = self.fetch(place)
        # 64 bits, as far as whole numbers go in JSON; float() cannot take them all.
        if kind is float and type(found) is int and abs(found) < 2**63:
            found = float(found)
        if type(found) is not kind:
            raise KinemimicError(f"{self.path}: {place}: expected {kind.__name__}, found {found!r:.40}")
        return found

    def array(self, place: str, shape: tuple[int, ...]) -> Array:
        try:
            array = np.array(self.fetch(place), dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            raise KinemimicError(
                f"{self.path}: {place}: expected numbers of shape {shape}, found other"
            ) from None
        if array.shape != shape:
            raise KinemimicError(f"{self.path}: {place}: expected shape {shape}, found {array.shape}")
        if (bad := np.argwhere(~(np.abs(array) < _LARGEST))).size:  # NaN too
            raise KinemimicError(
                f"{self.path}: {place}, index {bad[0, 0]}: expected finite numbers below {_LARGEST:g}, "
                f"found {array[tuple(bad[0])]:g}"
            )
        return array


def _parent_name(node: str) -> str | None:
    parent = NODE_PARENTS[NODE_INDEX[node]]
    return None if parent < 0 else NODES[parent]


def _rounded(array: Array) -> Any:
    # Adding zero turns -0.0 into 0.0: the sign of a value rounded to zero is noise.
    return (np.round(array, DECIMALS) + 0.0).tolist()
