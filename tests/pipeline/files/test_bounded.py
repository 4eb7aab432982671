"""Only regular files are read, up to a limit."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.bounded import MEGABYTE, read_bounded, require_regular


def test_a_file_within_its_limit_is_read_whole(tmp_path: Path) -> None:
    path = tmp_path / "a"
    for content in (b"", b"\x00\xffabc"):
        path.write_bytes(content)
        assert read_bounded(path, 5, "a thing") == content
    with pytest.raises(FileNotFoundError):
        read_bounded(tmp_path / "none", 5, "a thing")


def test_a_larger_file_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "a"
    with path.open("wb") as stream:
        stream.truncate(1 << 40)  # a hole: nothing lies on the disk
    with pytest.raises(KinemimicError, match=r"a: expected a thing of at most 2 MB, found a larger file"):
        read_bounded(path, 2 * MEGABYTE, "a thing")


def test_what_never_ends_is_not_opened(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/zero")):
        with pytest.raises(KinemimicError, match="expected a thing, found a pipe or a device"):
            read_bounded(path, 5, "a thing")
    with pytest.raises(KinemimicError, match="expected a thing, found a folder"):
        require_regular(tmp_path, "a thing")
