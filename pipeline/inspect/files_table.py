"""The tables on many files: a row per folder or file, then refusals, defect counts and totals."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from kinemimic.pipeline.cli.terminal import grid, heading, key_value_table, number
from kinemimic.pipeline.inspect.batch import count_rules, folder_summaries
from kinemimic.pipeline.inspect.file_report import OTHER, REFUSED, SIDECAR
from kinemimic.pipeline.quality.rules.defect import RULES

Report = dict[str, Any]

_NUMBER = re.compile(r"\d+(?:\.\d+)?")
_MAX_NAMED = 3  # more files with the same reason are counted


def files_table(reports: Sequence[Report], *, by_file: bool) -> RenderableType:
    """A row per folder if there are several; a row per file if `by_file`, or if there is one folder."""
    records = folder_summaries(reports)
    parts: list[RenderableType] = []
    if len(records) > 1:
        parts.append(_folders(records))
    if by_file or len(records) == 1:
        if parts:
            parts.append(Text())
        parts.append(_files(reports, with_folders=len(records) > 1))
    parts += _totals(reports, records)
    return Group(*parts)


def _folders(records: Sequence[dict[str, Any]]) -> Table:
    table = grid(
        "folder", "read", "frames", "thigh\nm", "shank\nm", "knee\n°", "gait\ns",
        "repaired", "flagged", "refused",
    )  # fmt: skip
    table.columns[0].no_wrap = True
    shared = common_folder([record["folder"] for record in records])
    for record in records:
        if not record["captures"]:
            continue
        read = str(record["read"])
        if record["read"] != record["captures"]:
            read += f" of {record['captures']}"
        table.add_row(
            str(Path(record["folder"]).relative_to(shared)),
            read,
            str(record["frames"]),
            number(record["thigh_m"], 2),
            number(record["shank_m"], 2),
            number(record["knee_peak_deg"], 0),
            number(record["gait_period_s"], 2),
            *(str(record[key] or "-") for key in ("repaired", "flagged", "refused")),
        )
    return table


def common_folder(names: Sequence[str]) -> Path:
    """The common parent folder, which the table need not repeat."""
    common = Path(names[0])
    while not all(Path(name).is_relative_to(common) for name in names):
        common = common.parent
    return common


def _files(reports: Sequence[Report], *, with_folders: bool) -> Table:
    table = grid(
        "file", "format", "frames", "Hz", "thigh\nm", "shank\nm", "knee\n°", "gait\ns", "verdict",
        left=2, gap=1,
    )  # fmt: skip
    table.columns[-1].justify = "left"
    table.columns[1].max_width = 19
    folder = Path()
    for report in _captures(reports):
        if with_folders and Path(report["file"]).parent != folder:
            folder = Path(report["file"]).parent
            table.add_row(Text(f"{folder.name}/", style="bold"))
        bones, angles, gait = report["bones_m"], report["angles"], report["gait"]
        table.add_row(
            Path(report["file"]).name,
            report["format"] or "-",
            str(report["frames"] or "-"),
            number(report["rate_hz"], 1),
            number(bones["thigh"]["median"] if bones else None, 2),
            number(bones["shank"]["median"] if bones else None, 2),
            number(angles["knee_peak_deg"] if angles else None, 0),
            number(gait["period_s"] if gait else None, 2),
            report["status"] + (", SIMULATED" if report["simulated"] else ""),
        )
    return table


def _totals(reports: Sequence[Report], records: Sequence[dict[str, Any]]) -> Iterator[RenderableType]:
    captures = _captures(reports)
    refused = [report for report in captures if report["status"] == REFUSED]
    if refused:
        yield heading("Refused")
        shared = common_folder([str(Path(report["file"]).parent) for report in captures])
        for line in reasons(refused, shared):
            # One line each, regardless of the terminal's width, so that they can be searched with grep.
            yield Text(line, no_wrap=True, overflow="ignore")
    table = key_value_table()
    usable = [report for report in captures if report["status"] != REFUSED]
    for title, group in (("repaired", captures), ("flagged", usable)):
        counts = count_rules(group, title)
        if counts:
            ranked = [f"{RULES[rule]} in {counts[rule]}" for rule in RULES if rule in counts]
            table.add_row(title, ", ".join(ranked))
    for title, key, most in (("sidecar files", "sidecar_files", 4), ("other files", "other", 40)):
        names = sorted({name for record in records for name in record[key]})
        if names:
            count = sum(len(record[key]) for record in records)
            more = f" and {len(names) - most} more" if len(names) > most else ""
            table.add_row(title, f"{count}: {', '.join(names[:most])}{more}")
    table.add_row("captures", f"{len(usable)} of {len(captures)} usable, {len(refused)} refused")
    yield heading("Total")
    yield table


def reasons(refused: Sequence[Report], shared: Path) -> Iterator[str]:
    """A line per file with its reason; one line for many files whose reasons differ only in numbers."""
    alike: dict[str, list[Report]] = {}
    for report in refused:
        alike.setdefault(_NUMBER.sub("#", report["reason"]), []).append(report)
    for group in alike.values():
        names = [str(Path(report["file"]).relative_to(shared)) for report in group]
        if len(group) <= _MAX_NAMED:
            yield from (f"{name}: {one['reason']}" for name, one in zip(names, group, strict=True))
        else:
            more = f"{', '.join(names[:_MAX_NAMED])} and {len(names) - _MAX_NAMED} more"
            yield f"{len(names)} similar files, {more}: {group[0]['reason']}"


def _captures(reports: Sequence[Report]) -> list[Report]:
    return [report for report in reports if report["status"] not in (OTHER, SIDECAR)]
