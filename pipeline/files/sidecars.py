"""Sidecar files of a capture NAME.*: its true motion and its provenance.

NAME.truth.parquet: the true joint angles of a simulated capture. NAME.provenance.json: how the capture was
made, which few formats can record.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.files.store import read_json, write_json, write_table
from kinemimic.pipeline.files.validation.schema import unchanged, upgraded
from kinemimic.pipeline.files.validation.tables import numbers, read_table
from kinemimic.pipeline.kinematics.angles import ANGLES

TRUTH, NOTE = ".truth.parquet", ".provenance.json"
TRUTH_SCHEMA = 1
NOTE_SCHEMA = 1


def stem_of(capture: Path) -> str:
    """The NAME of a capture NAME.skl or NAME.skl.gz, with which the names of its sidecar files begin."""
    return Path(capture.name.removesuffix(".gz")).stem


def beside(capture: Path, name: str) -> Path:
    """Path of a file that was read with a capture: NAME in the same folder, or "../FOLDER/NAME" in the next.

    ValueError for another name, which might lead anywhere.
    """
    up, *rest = PurePosixPath(name).parts
    if up != "..":
        return capture.with_name(name)
    if len(rest) != 2 or ".." in rest:
        raise ValueError(f"expected a file in a folder beside this one, found {name!r}")
    folder = capture.parent
    # A relative path may not name the capture's own folder.
    next_to_it = folder.with_name(rest[0]) if folder.name not in ("", "..") else folder / up / rest[0]
    return next_to_it / rest[1]


def truth_path(capture: Path) -> Path:
    """Path of a capture's truth file."""
    return capture.with_name(stem_of(capture) + TRUTH)


def note_path(capture: Path) -> Path:
    """Path of a capture's provenance note."""
    return capture.with_name(stem_of(capture) + NOTE)


def write_truth(
    path: Path, times: Array, passes: NDArray[np.int64], truth: Mapping[str, Array], note: Mapping[str, Any]
) -> None:
    """One row per frame of the capture: seconds, pass (-1: nobody in view), curves of ANGLES in radians and
    other true columns."""
    columns: dict[str, Any] = {"time": times, "pass": passes.astype(np.int32), **truth}
    write_table(path, columns, {"schema": TRUTH_SCHEMA, "provenance": note})


def read_truth(path: Path) -> dict[str, Array] | None:
    """Times (T,) in seconds and the curves of ANGLES (T,) in radians; None if the file is missing.

    CaptureError if it is not a truth file, KinemimicError if a later version wrote it.
    """
    if not path.is_file():
        return None
    kind, advice = "the truth of a simulated capture", "record it again"
    table, header = read_table(path, kind=kind, advice=advice)
    names = ("time", *ANGLES)
    if missing := [name for name in names if name not in table.column_names]:
        raise CaptureError(path, expected=kind, found=f"no column {', '.join(missing)}", advice=advice)
    upgraded(
        header if isinstance(header, dict) else {},
        path,
        kind="the truth of a capture",
        schema=TRUTH_SCHEMA,
        upgrades={0: unchanged},
        advice=advice,
    )
    try:
        truth = {name: numbers(table, name) for name in names}
    except ValueError as error:
        raise CaptureError(path, expected=kind, found=str(error), advice=advice) from None
    if not np.all(np.diff(truth["time"]) > 0) or not np.isfinite(truth["time"]).all():
        raise CaptureError(path, expected=kind, found="times that do not increase", advice=advice)
    return truth


def write_note(path: Path, note: Mapping[str, Any]) -> None:
    """Write a provenance note as JSON."""
    write_json(path, {"schema": NOTE_SCHEMA, **{key: note[key] for key in note if key != "schema"}})


def read_note(path: Path) -> dict[str, Any]:
    """Read a provenance note, written by `write_note` or by hand; empty if the file is missing."""
    if not path.is_file():
        return {}
    note = read_json(path)
    if not isinstance(note, dict):
        raise CaptureError(path, expected="a JSON object about the capture", found=type(note).__name__)
    note = upgraded(
        note,
        path,
        kind="a note about a capture",
        schema=NOTE_SCHEMA,
        upgrades={0: unchanged},
        advice="record it again",
    )
    return {name: value for name, value in note.items() if name != "schema"}
