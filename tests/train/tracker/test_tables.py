"""Reference tables of a library: made once, and again where the motions, their rate or the program differ."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from peers.trackers import entry, shipped_motion

from kinemimic.retarget.library.motion_library import MotionLibrary
from kinemimic.train.reference.reference_library import ReferenceLibrary
from kinemimic.train.tracker import tables
from kinemimic.train.tracker.tables import reference_tables


@pytest.fixture(scope="module")
def library() -> MotionLibrary:
    walk = shipped_motion("walk")
    slow = replace(walk, rate=0.95 * walk.rate)
    entries = [entry("walk", "a", "train", walk), entry("slow", "b", "train", slow)]
    return MotionLibrary.of([walk, slow], entries)


def durations(library: MotionLibrary, motions: list[int], out: Path, identity: str = "one") -> list[float]:
    folder = reference_tables(library, np.array(motions), out, identity)
    found: list[float] = ReferenceLibrary.open(folder).durations.tolist()
    return found


def test_other_motions_of_the_library_get_tables_of_their_own(library: MotionLibrary, tmp_path: Path) -> None:
    whole = [library.motion(k).duration for k in range(2)]
    for motions in ([1], [0, 1], [0]):
        assert durations(library, motions, tmp_path) == pytest.approx([whole[k] for k in motions])


@pytest.mark.parametrize("changed", ["identity", "rate", "version"])
def test_they_are_made_again_for_another(
    changed: str, library: MotionLibrary, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    durations(library, [0], tmp_path)
    kept = (tmp_path / "references/durations.npy").stat().st_mtime_ns
    durations(library, [0], tmp_path)
    assert (tmp_path / "references/durations.npy").stat().st_mtime_ns == kept
    if changed == "rate":
        monkeypatch.setattr(tables, "LIBRARY_TABLE_RATE", 60.0)
    if changed == "version":
        monkeypatch.setattr(tables, "versions", lambda: {"kinemimic": "0.0.1"})
    durations(library, [0], tmp_path, "two" if changed == "identity" else "one")
    assert (tmp_path / "references/durations.npy").stat().st_mtime_ns > kept
