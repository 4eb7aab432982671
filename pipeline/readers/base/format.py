"""The description of a capture format, for `kinemimic formats` and for error messages."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.readers.base.source import Source


@dataclass(frozen=True)
class Format:
    """A capture format.

    name: its usual name; sensor: what records it; holds: the content of a frame; recognised_by: the feature
    of the content by which it is recognised; columns: numbers per line that make a headerless table a
    candidate (empty for other formats); width_in_header: the header gives the number of columns;
    sidecar_file: the file that must be in the same folder; binary: the content is not text; right_handed: the
    axes are, in every program that writes the format.
    """

    name: str
    sensor: str
    holds: str
    recognised_by: str
    columns: tuple[int, ...] = ()
    width_in_header: bool = False
    sidecar_file: str = ""
    binary: bool = False
    right_handed: bool = False


class Reader(Protocol):
    """A module of this package that reads one format."""

    FORMAT: Format

    def recognises(self, source: Source) -> bool:
        """True if the content has the format's distinguishing feature. Looks at the head of the file only;
        never raises."""

    def read(self, source: Source) -> Clip:
        """The capture as recorded, in our units and axes. Raises CaptureError for damaged content."""
