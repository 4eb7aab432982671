"""What every reader says of its format: `kinemimic formats` lists it, errors name it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.readers.base.source import Source


@dataclass(frozen=True)
class Format:
    """name: what people call it; sensor: what records it; holds: what a frame is made of; told_by: the mark
    in the content by which it is recognised; columns: numbers a line by which a headerless table is known
    as a candidate (empty for formats that are no such tables); any_width: the numbers stand below a header
    that says how many they are; together_with: the file that must lie beside it; binary: the content is no
    text.
    """

    name: str
    sensor: str
    holds: str
    told_by: str
    columns: tuple[int, ...] = ()
    any_width: bool = False
    together_with: str = ""
    binary: bool = False


class Reader(Protocol):
    """A module of this package that reads one format."""

    FORMAT: Format

    def recognises(self, source: Source) -> bool:
        """True if the content bears the format's mark; looks at the head of the file only, never raises."""

    def read(self, source: Source) -> Clip:
        """The capture, as recorded, in our units and axes; CaptureError for what is damaged."""
