"""Only regular files are read, up to a limit."""

from __future__ import annotations

import fcntl
import os
import signal
import threading
from pathlib import Path

import pytest

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.validation import bounded
from kinemimic.pipeline.files.validation.bounded import MEGABYTE, read_bounded, require_regular


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


def test_a_device_that_counts_as_a_file_is_empty() -> None:
    path = Path("/proc/kmsg")  # the kernel's log: reading waits for the next message
    if not os.access(path, os.R_OK):
        pytest.skip("needs the superuser")
    assert path.is_file()
    assert read_bounded(path, 5, "a thing") == b""


def test_a_file_that_delivers_nothing_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a").write_bytes(b"abc")
    monkeypatch.setattr(bounded, "STALLED", 0.2)
    released = threading.Event()
    stat = Path.stat

    def stalling(path: Path, **options: bool) -> os.stat_result:
        if path.name == "a" and threading.current_thread() is not threading.main_thread():
            released.wait(20.0)  # as on a network mount whose server is gone
        return stat(path, **options)

    monkeypatch.setattr(Path, "stat", stalling)
    with pytest.raises(KinemimicError, match=r"a: expected a thing, found no data for 0.2 s; copy the file"):
        read_bounded(tmp_path / "a", 5, "a thing")
    released.set()


def test_a_file_that_another_program_has_leased_does_not_block(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"abc")
    handle = os.open(path, os.O_RDWR)
    earlier = signal.signal(signal.SIGIO, signal.SIG_IGN)  # the kernel's request to give the lease back
    try:
        fcntl.fcntl(handle, fcntl.F_SETLEASE, fcntl.F_WRLCK)
    except OSError:
        pytest.skip("leases need another file system")
    try:
        with pytest.raises(BlockingIOError):
            read_bounded(path, 5, "a thing")
    finally:
        os.close(handle)
        signal.signal(signal.SIGIO, earlier)
