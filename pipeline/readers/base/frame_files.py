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
_NUMBER = re.compile(r"(?P<front>.*?)(?P<number>\d{1,12})(?P<behind>\D*\.json)", re.IGNORECASE)
# A frame that is a list is one of people.
_PEOPLE = "people"


def is_folder_of_frames(path: Path) -> bool:
    """True for a folder of nothing but small JSON files whose names differ in their number alone, and hidden
    files, which file managers leave behind."""
    names = set()
    count = 0
    try:
        with os.scandir(path) as entries:
            for entry in entries:
                if _is_hidden(entry.name):
                    continue
                match = _NUMBER.fullmatch(entry.name)
                if match is None or not entry.is_file() or entry.stat().st_size > _MOST_BYTES:
                    return False
                names.add((match["front"], match["behind"]))
                count += 1
                if len(names) > 1 or count > _MOST:
                    return False
    except OSError:  # no folder, or not ours to read
        return False
    return count >= _FEWEST


def open_frames(folder: Path, unit: str | None = None) -> Source:
    """The frames of such a folder in the order of their numbers, as one JSON text with these.

    Raises CaptureError for a file that is no JSON, and for more bytes than any capture has.
    """
    frames: list[str] = []
    size = 0
    digest = hashlib.sha256()
    files = (path for path in folder.iterdir() if not _is_hidden(path.name))
    for number, path in sorted((_number(path), path) for path in files):
        source = Source.open(path)
        digest.update(source.content)
        frame = parse_json(source)
        of_frame: dict[str, Any] = frame if isinstance(frame, dict) else {_PEOPLE: frame}
        frames.append(json.dumps({"frame": number, **of_frame}))
        size += len(frames[-1])
        if size > MAX_BYTES:
            raise CaptureError(folder, expected=f"frames of at most {MAX_BYTES >> 20} MB", found="more")
    return Source(folder, f"[{', '.join(frames)}]".encode(), digest.hexdigest(), unit)


def _is_hidden(name: str) -> bool:
    return name.startswith(".")


def _number(path: Path) -> int:
    match = _NUMBER.fullmatch(path.name)
    assert match is not None  # noqa: S101 (is_folder_of_frames() holds)
    return int(match["number"])
