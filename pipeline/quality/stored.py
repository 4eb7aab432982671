"""quality.json and gimbal.json as later stages read them: upgraded and checked."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from msgspec import Meta, Struct

from kinemimic.pipeline.errors import CaptureError, KinemimicError
from kinemimic.pipeline.files.store import read_json
from kinemimic.pipeline.files.validation.fields import Count, FrameRange, Number, Share, checked
from kinemimic.pipeline.files.validation.records import one_of
from kinemimic.pipeline.files.validation.schema import upgraded
from kinemimic.pipeline.kinematics.gimbal import GIMBAL_SCHEMA
from kinemimic.pipeline.quality.rules.defect import RULES

QUALITY_SCHEMA = 2
ORIENTATION_SCHEMA = 1


class _Units(Struct):
    length: str
    rule: str


class _Defect(Struct):
    rule: Annotated[str, one_of(tuple(RULES))]
    count: Count
    unit: str
    action: Literal["repaired", "flagged", "refused"]
    text: str
    frames: list[FrameRange]


class _Clock(Struct):
    rate_hz: Annotated[float, Meta(gt=0, le=1e6)]
    step_ms: Number
    jitter_ms: Number
    longest_step_ms: Number


# "pass" is a keyword.
class _Pass(Struct, rename={"number": "pass"}):
    number: Count
    first_frame: Count
    last_frame: Count
    start: Number
    end: Number
    complete_frames: Count


class _Event(Struct):
    frame: Count
    time: Number
    state: str
    reason: str


class _Joint(Struct):
    tracked: Share | None
    inferred: Share | None
    missing: Share | None
    filled: Share | None
    bone_m: Number | None
    bone_cv: Number | None


class Quality(Struct):
    """quality.json."""

    schema: int
    source: str
    format: str
    sidecar_files: dict[str, str]
    simulated: bool
    units: _Units
    frames: Count
    frames_in_passes: Count
    complete_frames: Count
    defects: list[_Defect]
    clock: _Clock
    passes: list[_Pass]
    passes_discarded: Count
    events: list[_Event]
    joints: dict[str, _Joint]
    notes: list[str]
    processing: list[str]


class _GimbalJoint(Struct):
    joint: str
    order: str
    lock_at_deg: list[Number]
    nearest_deg: Number
    nearest_frame: Count
    flagged_frames: list[FrameRange]
    flips: list[Count]


class Gimbal(Struct):
    """gimbal.json."""

    frames: Count
    flag_within_deg: Number
    flip_beyond_deg: Number
    joints: list[_GimbalJoint]
    schema: Annotated[int, Meta(ge=0, le=GIMBAL_SCHEMA)] = 0


def read_quality(path: Path) -> dict[str, Any]:
    """The quality report of a file, upgraded to the current schema; KinemimicError for other JSON."""
    advice = "run `ingest` again"
    document = _read_object(path, advice)
    try:
        report = upgraded(
            document,
            path,
            kind="a quality report",
            schema=QUALITY_SCHEMA,
            upgrades={1: _from_schema_1},
            advice=advice,
        )
    except (AttributeError, KeyError, TypeError):
        raise KinemimicError(f"{path}: expected a quality report, found other JSON; {advice}") from None
    return checked(report, Quality, path, advice=advice)


def read_gimbal(path: Path) -> dict[str, Any]:
    """The gimbal report of a file; KinemimicError for other JSON."""
    return checked(_read_object(path, "run `convert` again"), Gimbal, path, advice="run `convert` again")


def _read_object(path: Path, advice: str) -> dict[str, Any]:
    document = read_json(path)
    if not isinstance(document, dict):
        raise CaptureError(path, expected="a JSON object", found=type(document).__name__, advice=advice)
    return document


def _from_schema_1(old: Mapping[str, Any]) -> Mapping[str, Any]:
    """Schema 1 had the keys companions, done, a joint's "lost" share, and "of" in a defect."""
    new = {key: value for key, value in old.items() if key not in ("companions", "done")}
    joints = {
        name: {"missing" if key == "lost" else key: value for key, value in joint.items()}
        for name, joint in old["joints"].items()
    }
    defects = [
        {"unit" if key == "of" else key: value for key, value in defect.items()} for defect in old["defects"]
    ]
    new |= {"sidecar_files": old.get("companions", {}), "processing": old["done"]}
    return {**new, "joints": joints, "defects": defects}
