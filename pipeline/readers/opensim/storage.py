"""Headers of OpenSim's storage files (.mot, .sto): lines KEY=VALUE until endheader, then columns' names."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.base.source import Source


class StorageHeader(NamedTuple):
    """values: VALUE by KEY in lower case; names_line: the line (from 0) of the columns' names."""

    values: Mapping[str, str]
    names_line: int


def ends_header(line: str) -> bool:
    """Whether a line is the last of a header."""
    return line.strip().lower() == "endheader"


def storage_header(source: Source) -> StorageHeader:
    """The header, without values where the first line has the names; CaptureError if there are no names."""
    end = next((k for k, line in enumerate(source.lines) if ends_header(line)), -1)
    values = {
        key.strip().lower(): value.strip()
        for key, _, value in (line.partition("=") for line in source.lines[: end + 1])
    }
    start = next((k for k in range(end + 1, len(source.lines)) if source.lines[k].strip()), None)
    if start is None:
        raise source.error(
            expected="column names below endheader", found="none", advice="the file is cut off"
        )
    return StorageHeader(values, start)


def rows_cut_off(header: StorageHeader, rows: int) -> list[Defect]:
    """A defect if the header declares more rows than the file has."""
    stated = header.values.get("nrows", "")
    # A header with more rows than any recording has is itself damaged.
    declared = int(stated) if stated.isascii() and stated.isdigit() and len(stated) < 9 else 0
    if declared <= rows:
        return []
    text = f"the header declares {declared} rows but the file has {rows}: it may be cut off"
    return [Defect("dropped_frames", declared - rows, "frames", "flagged", text)]
