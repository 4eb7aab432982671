"""One comparison at a time in a folder, and its progress when it is resumed."""

from __future__ import annotations

import errno
import fcntl
import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from peers.holding import held_elsewhere

from kinemimic.evaluate.compare.ledger import Ledger, ProgressBars, exclusive
from kinemimic.pipeline.cli.progress import Bars
from kinemimic.pipeline.cli.progress_state import ProgressState
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


def training(done: float) -> ProgressState:
    return ProgressState("train", done, 1e6, "samples", seconds=0.0, left=None, per_second=None, notes={})


def test_samples_from_before_an_interruption_do_not_shorten_the_time_left() -> None:
    """Cells a, resumed at 900,000 of a million samples, and b, at 1,000 a second each."""
    now = [0.0]
    several = Bars(None, clock=lambda: now[0])
    a, b = cast(list[Any], [SimpleNamespace(name=name, budgets=[1_000_000]) for name in "ab"])
    ledger = SimpleNamespace(cells=[a, b], failed={}, finished=lambda cell: {})
    watcher = ProgressBars(several, cast(Ledger, ledger))
    for cell in (a, b):
        watcher.begun(cell)
    watcher.advanced(a, training(900_000))
    watcher.advanced(b, training(1_000))
    now[0] = 10.0
    watcher.advanced(a, training(910_000))
    watcher.advanced(b, training(11_000))
    whole, *each = several.states()
    assert [one.done for one in (whole, *each)] == [921_000, 910_000, 11_000]
    assert [one.per_second for one in (whole, *each)] == pytest.approx([2000.0, 1000.0, 1000.0])
    assert [one.left for one in (whole, *each)] == pytest.approx([539.5, 90.0, 989.0])
