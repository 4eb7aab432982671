"""One comparison at a time in a folder."""

from __future__ import annotations

import errno
import fcntl
import os
from pathlib import Path

import pytest
from peers.holding import held_elsewhere

from kinemimic.evaluate.compare.ledger import exclusive
from kinemimic.pipeline.errors import KinemimicError


def test_a_second_comparison_is_refused(tmp_path: Path) -> None:
    with (
        held_elsewhere(tmp_path),
        pytest.raises(KinemimicError, match="no other comparison in this folder, found one running"),
        exclusive(tmp_path),
    ):
        pass
    with exclusive(tmp_path):
        pass
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("number", [errno.ENOLCK, errno.EOPNOTSUPP])
def test_a_file_system_without_locks_is_no_error(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(fcntl, "flock", refuse)
    with exclusive(tmp_path / "out"):
        pass
