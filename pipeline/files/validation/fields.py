"""Types of the values in JSON files of results, and the check of a file against them.

The bounds are far from what occurs: they keep damaged numbers out of tables and figures.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta

from kinemimic.pipeline.files.validation.records import convert

_LARGEST = 1e9

Number = Annotated[float, Meta(ge=-_LARGEST, le=_LARGEST)]
Count = Annotated[int, Meta(ge=0, le=int(_LARGEST))]
Share = Annotated[float, Meta(ge=0, le=1)]
Interval = tuple[Number, Number]
FrameRange = tuple[Count, Count]


def checked(document: Mapping[str, Any], kind: type, path: Path, *, advice: str) -> dict[str, Any]:
    """The document, if it has the fields of a msgspec Struct; others are not looked at.

    CaptureError names the first field that does not fit. advice: what the user can do then.
    """
    convert(document, kind, path, advice=advice)
    return dict(document)
