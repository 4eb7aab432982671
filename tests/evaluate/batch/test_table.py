"""Counts of a batch and its totals, from rows alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.console import Console

from kinemimic.evaluate.batch.row import ACCEPTED
from kinemimic.evaluate.batch.table import counts, tables


def row(name: str, kind: str | None, cyclic: bool | None) -> dict[str, Any]:
    return {
        "file": str(Path("/captures") / name),
        "status": ACCEPTED,
        "stage": None,
        "kind": kind,
        "cyclic": cyclic,
        "strides_used": None,
        "strides_found": None,
        "period_s": None,
        "speed_m_s": None,
        "path": None,
        "findings": [],
        "seconds": 1.0,
        "verdict": None,
        "sidecar_files": [],
    }


def totals(rows: list[dict[str, Any]]) -> str:
    console = Console(width=100)
    with console.capture() as captured:
        for part in tables(rows, counts(rows)):
            console.print(part)
    return captured.get().partition("Total")[2]


def test_captures_that_end_before_a_motion_have_no_kind() -> None:
    rows = [row("a.skl", None, None), row("b.skl", None, None)]
    found = counts(rows)
    assert (found["accepted"], found["loops"], found["as_recorded"], found["kinds"]) == (2, 0, 0, {})
    text = totals(rows)
    assert "2 of 2" in text
    assert "loop" not in text and "kinds" not in text


def test_motions_are_counted_by_kind() -> None:
    rows = [row("a.skl", "walk", True), row("b.skl", "run", True), row("c.skl", "motion", False)]
    found = counts(rows)
    assert (found["loops"], found["as_recorded"]) == (2, 1)
    assert found["kinds"] == {"walk": 1, "run": 1, "motion": 1}
    assert "3 of 3: 2 loops, 1 as recorded" in totals(rows)
