"""gait.json as other stages read it, whichever version of kinemimic wrote it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.schema import unchanged, upgraded
from kinemimic.pipeline.files.store import read_json

GAIT_SCHEMA = 2


def read_gait_json(path: Path) -> dict[str, Any]:
    """The report of `retarget` in today's schema; a KinemimicError if the file holds other JSON."""
    document = read_json(path)
    advice = "run `retarget` again"
    try:
        return upgraded(
            dict(document),
            path,
            kind="a gait report",
            schema=GAIT_SCHEMA,
            advice=advice,
            upgrades={0: unchanged, 1: _from_1},
        )
    except (AttributeError, TypeError, ValueError):
        raise KinemimicError(f"{path}: expected a report of `retarget`, found other JSON; {advice}") from None


def _from_1(document: Mapping[str, Any]) -> dict[str, Any]:
    """Schema 2 renamed `believed`, `strides_followed` of a pass and `text` of a gate finding."""
    return {
        **_renamed(document, "believed", "reliability"),
        **{
            key: [_renamed(row, old, new) for row in document[key]]
            for key, old, new in (
                ("passes", "strides_followed", "strides_timed_individually"),
                ("gate", "text", "message"),
            )
            if key in document
        },
    }


def _renamed(row: Mapping[str, Any], old: str, new: str) -> dict[str, Any]:
    return {(new if key == old else key): value for key, value in row.items()}
