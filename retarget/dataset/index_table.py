"""The index of a data set, and its checksums: written by a batch, read to compare two data sets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.files.store import file_hash, write_table, write_text
from kinemimic.pipeline.files.validation.schema import upgraded
from kinemimic.pipeline.files.validation.tables import read_table
from kinemimic.retarget.dataset.columns import DATASET_SCHEMA, INDEX, INDEX_COLUMNS, SUMS
from kinemimic.retarget.dataset.shards import read_motion
from kinemimic.retarget.humanoid.motion import Motion

_KIND, _ADVICE = "the index of a data set of motions", "make it again with `kinemimic batch`"


def write_rows(folder: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write the index; keys of a row that are not columns are left out, missing ones are null."""
    columns = {
        name: pa.array([row.get(name) for row in rows], type=kind)
        for name, (kind, _) in INDEX_COLUMNS.items()
    }
    header = {"schema": DATASET_SCHEMA, "columns": {name: text for name, (_, text) in INDEX_COLUMNS.items()}}
    write_table(folder / INDEX, columns, header)


def is_dataset(folder: Path) -> bool:
    """Whether a folder has an index; `read_rows` says whether it is one."""
    return (folder / INDEX).is_file()


def read_rows(folder: Path) -> dict[str, dict[str, Any]]:
    """Name -> row of the index; CaptureError for a damaged one and for other tables."""
    path = folder / INDEX
    try:
        table, header = read_table(path, kind=_KIND, advice=_ADVICE)
    except FileNotFoundError:
        raise CaptureError(path, expected=_KIND, found="no file", advice=_ADVICE) from None
    if not isinstance(header, dict) or "columns" not in header:
        raise CaptureError(path, expected=_KIND, found="another table", advice=_ADVICE)
    upgraded(header, path, kind=_KIND, schema=DATASET_SCHEMA, advice=_ADVICE)
    if missing := [name for name in ("name", "status", "motion", "shard") if name not in table.column_names]:
        raise CaptureError(path, expected=_KIND, found=f"no column {missing[0]}", advice=_ADVICE)
    return {row["name"]: row for row in table.to_pylist()}


def motion_of(folder: Path, row: Mapping[str, Any]) -> Motion:
    """The motion of a row that has one."""
    shard = str(row["shard"])
    if Path(shard).is_absolute() or ".." in Path(shard).parts:
        raise CaptureError(folder / INDEX, expected="shards in this folder", found=shard, advice=_ADVICE)
    return read_motion(
        folder,
        shard,
        row["name"],
        rate=row["motion_rate_hz"],
        cyclic=row["cyclic"],
        cycle_offset=np.array(row["cycle_offset_m"]),
        simulated=row["simulated"],
    )


def write_sums(folder: Path) -> None:
    """Write SHA256SUMS, which `sha256sum --check` reads: all other files of the folder."""
    files = sorted(path for path in folder.rglob("*") if path.is_file() and path.name != SUMS)
    lines = [f"{file_hash(path)}  {path.relative_to(folder).as_posix()}\n" for path in files]
    write_text(folder / SUMS, "".join(lines))
