"""Folders of JSON files that hold a frame each, as OpenPose and EasyMocap write them: one capture."""

from __future__ import annotations

import hashlib
import json
import os
import re
from pathlib import Path
from typing import Any

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.readers.base.json_text import parse_json
from kinemimic.pipeline.readers.base.source import MAX_BYTES, Source

# Fewer files are captures of their own, and so are larger ones: a second of a body takes more bytes.
_FEWEST, _MOST_BYTES = 10, 2**15
# Two hours at 30 Hz.
_MOST = 216_000
_NUMBER = re.compile(r"(?P<front>.*?)(?P<number>\d{2,12})(?P<behind>\D*\.json)", re.IGNORECASE)
# A frame that is a list is one of people.
_PEOPLE = "people"


def is_folder_of_frames(path: Path) -> bool:
    """True for a folder of nothing but small JSON files whose names differ in their number alone."""
    if not path.is_dir():
        return False
    names = set()
    count = 0
    for entry in os.scandir(path):
        match = _NUMBER.fullmatch(entry.name)
        if match is None or not entry.is_file() or entry.stat().st_size > _MOST_BYTES:
            return False
        names.add((match["front"], match["behind"]))
        count += 1
        if len(names) > 1 or count > _MOST:
            return False
    return count >= _FEWEST


def open_frames(folder: Path, unit: str | None = None) -> Source:
    """The frames of such a folder in the order of their numbers, as one JSON text with these.

    Raises CaptureError for a file that is no JSON, and for more bytes than any capture has.
    """
    frames: list[dict[str, Any]] = []
    digest = hashlib.sha256()
    for number, path in sorted((_number(path), path) for path in folder.iterdir()):
        source = Source.open(path)
        digest.update(source.content)
        frame = parse_json(source)
        frames.append({"frame": number, **(frame if isinstance(frame, dict) else {_PEOPLE: frame})})
    text = json.dumps(frames)
    if len(text) > MAX_BYTES:
        raise CaptureError(folder, expected=f"frames of at most {MAX_BYTES >> 20} MB", found="more")
    return Source(folder, text.encode(), digest.hexdigest(), unit)


def _number(path: Path) -> int:
    match = _NUMBER.fullmatch(path.name)
    assert match is not None  # noqa: S101 (is_folder_of_frames() holds)
    return int(match["number"])
