"""The rows of a batch as CSV, as a table with totals, and counted."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from kinemimic.evaluate.batch.row import ACCEPTED, FAILED
from kinemimic.evaluate.batch.task import Row
from kinemimic.pipeline.cli.terminal import grid, heading, key_value_table, number
from kinemimic.pipeline.files.sidecars import beside
from kinemimic.pipeline.inspect.file_report import OTHER, REFUSED
from kinemimic.pipeline.inspect.files_table import common_folder, reasons
from kinemimic.pipeline.plural import plural


def counts(rows: Sequence[Row]) -> dict[str, Any]:
    """The numbers of captures, of accepted motions by kind, and of refusals by stage."""
    accepted = [row for row in rows if row["status"] == ACCEPTED]
    # `--to ingest` and `--to clip` end before there is a motion.
    motions = [row for row in accepted if row["kind"] is not None]
    return {
        "captures": len(rows),
        "accepted": len(accepted),
        "loops": sum(bool(row["cyclic"]) for row in motions),
        "as_recorded": sum(not row["cyclic"] for row in motions),
        "kinds": dict(Counter(row["kind"] for row in motions)),
        "performed": sum(row["verdict"] is not None for row in accepted),
        "refused": dict(Counter(row["stage"] for row in rows if row["status"] == REFUSED)),
        "failed": sum(row["status"] == FAILED for row in rows),
    }


def captures_among(rows: Sequence[Row]) -> tuple[list[Row], list[Row]]:
    """The rows of captures, and those of other files; of two files that are read with each other, the first
    is the capture, and the second has no row."""
    read: list[Row] = []
    read_with: set[Path] = set()
    for row in rows:
        file = Path(row["file"])
        if row["status"] != OTHER and file not in read_with:
            read.append(row)
            read_with |= {beside(file, name) for name in row["sidecar_files"]}
    return read, [row for row in rows if row["status"] == OTHER]


def rows_csv(rows: Sequence[Row]) -> str:
    """One line per capture; unknown values are empty, lists are separated by semicolons."""
    stream = io.StringIO()
    writer = csv.DictWriter(stream, list(rows[0]) if rows else ["file"], lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow(
            {key: "; ".join(value) if isinstance(value, list) else value for key, value in row.items()}
        )
    return stream.getvalue()


def tables(rows: Sequence[Row], counted: Mapping[str, Any]) -> Iterator[RenderableType]:
    """A line per capture, the reasons of those without an accepted motion, and the totals."""
    shared = common_folder([str(Path(row["file"]).parent) for row in rows])
    yield _captures(rows, shared)
    unaccepted = [row for row in rows if row["status"] != ACCEPTED]
    if unaccepted:
        yield heading("Refused")
        # One line each, regardless of the terminal's width, so that they can be searched with grep. In a
        # group, because rich wraps a lone text.
        lines = reasons(unaccepted, shared)
        yield Group(*(Text(line, no_wrap=True, overflow="ignore") for line in lines))
    yield heading("Total")
    yield _totals(counted)


def _captures(rows: Sequence[Row], shared: Path) -> Table:
    table = grid(
        "file", "motion", "", "strides\nused", "\nfound", "period\ns", "speed\nm/s", "path", "findings", "s",
        left=3, gap=1,
    )  # fmt: skip
    for row in rows:
        loop = {True: "loop", False: "as recorded", None: ""}[row["cyclic"]]
        table.add_row(
            str(Path(row["file"]).relative_to(shared)),
            row["status"] + (f" ({row['stage']})" if row["stage"] else ""),
            " ".join(filter(None, (row["kind"], loop))),
            number(row["strides_used"], 1),
            number(row["strides_found"], 0),
            number(row["period_s"], 2),
            number(row["speed_m_s"], 2),
            row["path"] or "-",
            str(len(row["findings"]) or "-"),
            number(row["seconds"], 1),
        )
    return table


def _totals(counted: Mapping[str, Any]) -> Table:
    table = key_value_table()
    loops = plural(counted["loops"], "loop")
    kinds = f": {loops}, {counted['as_recorded']} as recorded" if counted["kinds"] else ""
    table.add_row("accepted", f"{counted['accepted']} of {counted['captures']}{kinds}")
    for title, key in (("kinds", "kinds"), ("refused by", "refused")):
        if counted[key]:
            table.add_row(title, ", ".join(f"{name} {count}" for name, count in counted[key].items()))
    if counted["performed"]:
        table.add_row("performed", f"{counted['performed']} by the tracker")
    if counted["failed"]:
        table.add_row("failed", str(counted["failed"]))
    return table
