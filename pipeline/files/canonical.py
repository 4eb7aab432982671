"""Arrays in a canonical file with the same bytes on every machine, by which a data set is locked.

Numbers are rounded to 1e-5 (10 µm, 0.002°), far above the differences between processors, so that only a
value right at a rounding edge could differ. The file contains no times, versions or paths.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.json_layout import layout
from kinemimic.pipeline.files.store import content_hash, read_json, write_text
from kinemimic.pipeline.files.validation.schema import upgraded
from kinemimic.pipeline.kinematics.clip import Clip

FORMAT, SCHEMA, DECIMALS = "kinemimic.arrays", 1, 5
_OF_CLIP = (
    "times", "positions", "states", "passes", "euler", "translations", "rotations", "rests", "world_from_file"
)  # fmt: skip


@dataclass(frozen=True)
class Canonical:
    """kind: "clip" or "motion"; joints: names along the joint axis; arrays: rounded, NaN where nothing was
    measured; facts: other information about the arrays, as JSON values."""

    kind: str
    joints: tuple[str, ...]
    arrays: Mapping[str, Array]
    facts: Mapping[str, Any]

    @classmethod
    def of(
        cls, kind: str, joints: tuple[str, ...], arrays: Mapping[str, Any], facts: Mapping[str, Any]
    ) -> Canonical:
        """Round the arrays; zero and NaN become positive, since their signs are noise."""
        return cls(kind, joints, {name: _rounded(array) for name, array in arrays.items()}, facts)

    @classmethod
    def of_clip(cls, clip: Clip) -> Canonical:
        """The measured arrays of a clip and its skeleton; also the rotations of a converted clip."""
        found = {
            **{name: getattr(clip, name) for name in _OF_CLIP},
            **{f"angle.{name}": curve for name, curve in (clip.angles or {}).items()},
            "parents": clip.skeleton.parents,
            "offsets": clip.skeleton.offsets,
        }
        return cls.of(
            "clip",
            clip.skeleton.names,
            {name: array for name, array in found.items() if array is not None},
            {"simulated": clip.simulated, "orders": None if clip.orders is None else list(clip.orders)},
        )

    @property
    def identity(self) -> str:
        """SHA-256 of names and values."""
        described = json.dumps([self.kind, self.joints, self.facts], sort_keys=True)
        return content_hash({**self.arrays, "": np.array(described)})

    def write(self, path: Path) -> None:
        """Write the file; equal arrays give equal bytes."""
        document = {
            "format": FORMAT,
            "schema": SCHEMA,
            "kind": self.kind,
            "decimals": DECIMALS,
            "joints": list(self.joints),
            "facts": self.facts,
            "arrays": {name: _values(array) for name, array in self.arrays.items()},
        }
        write_text(path, layout(document) + "\n")

    @classmethod
    def read(cls, path: Path) -> Canonical:
        """Read a file of `write`; KinemimicError for any other."""
        document = read_json(path)
        found = document.get("format") if isinstance(document, dict) else None
        if found != FORMAT:
            raise KinemimicError(f"{path}: expected {FORMAT}, found {found!r}")
        document = upgraded(document, path, kind="arrays", schema=SCHEMA, advice="build them again")
        try:
            arrays = {name: np.array(rows, dtype=np.float64) for name, rows in document["arrays"].items()}
            return cls(document["kind"], tuple(document["joints"]), arrays, dict(document["facts"]))
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise KinemimicError(
                f"{path}: expected arrays of numbers, found {error}; build it again"
            ) from None


def _rounded(array: Any) -> Array:
    values = np.round(np.asarray(array, dtype=np.float64), DECIMALS) + 0.0
    return np.where(np.isnan(values), np.nan, values)


def _values(array: Array) -> Any:
    """Nested lists, None for NaN, integers without a decimal point."""
    if array.ndim == 0:
        return _plain(float(array))
    return [_values(row) for row in array] if array.ndim > 1 else [_plain(v) for v in array.tolist()]


def _plain(value: float) -> float | int | None:
    if np.isnan(value):
        return None
    return int(value) if value.is_integer() else value
