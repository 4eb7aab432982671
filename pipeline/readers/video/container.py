"""Recognise a video by its first bytes; cheap to import, because every capture is tested for it."""

from __future__ import annotations

from pathlib import Path

from kinemimic.pipeline.readers.base.format import Format

FORMAT = Format(
    name="video",
    sensor="one camera that stands still",
    holds="images of a person; BlazePose and a fitted body make positions of them (the extra `video`)",
    recognised_by="the first bytes of MP4, MOV, WebM, AVI or MPEG",
    binary=True,
)
# The boxes that begin an MP4 or MOV file, and the first bytes of Matroska (WebM), AVI, and MPEG files.
_BOXES: tuple[bytes, ...] = (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip")
_MAGIC: tuple[bytes, ...] = (b"\x1aE\xdf\xa3", b"\x00\x00\x01\xba", b"\x00\x00\x01\xb3")
_HEAD_BYTES = 12


def is_video(path: Path) -> bool:
    """True for a file that begins as MP4, MOV, WebM, Matroska, AVI or MPEG do; never raises."""
    try:
        if not path.is_file():  # opening a pipe blocks
            return False
        with path.open("rb") as stream:
            head = stream.read(_HEAD_BYTES)
    except OSError:
        return False
    riff = head[:4] == b"RIFF" and head[8:12] == b"AVI "
    return riff or head[4:8] in _BOXES or head.startswith(_MAGIC)
