"""The lock of a run folder, at the moments at which another command removes or takes the folder."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path

import pytest

from kinemimic.pipeline.run_folder import lock
from kinemimic.pipeline.run_folder.lock import locked


def is_held(run: Path) -> bool:
    """Whether another descriptor of the folder cannot be locked."""
    handle = os.open(run, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(handle)
    return False


def test_an_empty_folder_is_removed_while_it_is_held(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run, there, close = tmp_path / "run", list[bool](), os.close

    def closed(handle: int) -> None:
        there.append(run.exists())
        close(handle)

    with locked(run):
        monkeypatch.setattr(lock.os, "close", closed)
    monkeypatch.undo()
    assert there == [False]


@pytest.mark.parametrize("again", [True, False])
def test_a_folder_that_is_removed_in_between_is_locked_anew(
    again: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run, flock, calls = tmp_path / "run", fcntl.flock, list[int]()

    def removed_first(handle: int, how: int) -> None:
        if not calls:
            run.rmdir()
            if again:
                run.mkdir()
        calls.append(handle)
        flock(handle, how)

    monkeypatch.setattr(lock.fcntl, "flock", removed_first)
    with locked(run):
        monkeypatch.undo()
        assert is_held(run)
        (run / "result").write_text("kept")
    assert (run / "result").read_text() == "kept"
