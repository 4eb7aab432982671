"""What went into a motion library and what was refused, as tables for a terminal."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from rich.console import Group, RenderableType
from rich.text import Text

from kinemimic.pipeline.cli.terminal import grid, heading, key_value_table
from kinemimic.pipeline.plural import plural
from kinemimic.retarget.library.motion_library import Entry


def tables(manifest: Mapping[str, Any]) -> Iterator[RenderableType]:
    """A line per subject, the refused captures with their reasons, and the totals of both splits."""
    names = list(Entry.__dataclass_fields__)
    entries = [Entry(**{name: motion[name] for name in names}) for motion in manifest["motions"]]
    subjects = grid("subject", "split", "motions", "loops", "seconds", left=2, gap=2)
    for subject in sorted({entry.subject for entry in entries}):
        own = [entry for entry in entries if entry.subject == subject]
        subjects.add_row(
            subject,
            own[0].split,
            str(len(own)),
            str(sum(entry.cyclic for entry in own)),
            f"{sum(entry.duration for entry in own):.1f}",
        )
    yield subjects
    if manifest["refused"]:
        yield heading("Refused")
        # One line each, so that they can be searched with grep; in a group, because rich wraps a lone text.
        lines = (f"{Path(file).name}: {reason}" for file, reason in manifest["refused"].items())
        yield Group(*(Text(line, no_wrap=True, overflow="ignore") for line in lines))
    yield heading("Total")
    totals = key_value_table()
    for split, of in manifest["splits"].items():
        kinds = ", ".join(f"{kind} {count}" for kind, count in of["motions"].items()) or "no motions"
        totals.add_row(split, f"{plural(len(of['subjects']), 'subject')}: {kinds}")
    yield totals
