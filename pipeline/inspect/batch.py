"""Inspect many files in a process pool, and summarise their reports by folder."""

from __future__ import annotations

import stat
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

from kinemimic.pipeline.files.sidecars import beside
from kinemimic.pipeline.inspect.file_report import (
    OTHER,
    REFUSED,
    SIDECAR,
    InspectedFile,
    file_report,
    inspect_file,
    unread_report,
)
from kinemimic.pipeline.parallel.task_pool import MEMORY, TIMEOUT, Failure, isolated_map
from kinemimic.pipeline.readers.base.source import MAX_BYTES
from kinemimic.pipeline.readers.video.container import is_video

Report = dict[str, Any]

# What a file may take besides TIMEOUT and MEMORY: for a million frames (400 MB of text) 400 s and 5 GB.
_SECONDS_PER_BYTE = 1e-6
_MEMORY_PER_BYTE = 12
# Networks look at every frame: some ten minutes of video.
_SECONDS_PER_VIDEO = 3600.0


def file_reports(
    files: Sequence[Path], *, jobs: int, unit: str | None = None, rate: float | None = None
) -> Iterator[Report]:
    """The report on each file, in order of completion; a damaged file affects only its own report.

    jobs: number of worker processes; unit, rate: those of all files, as in `recognise.read`.
    """
    work = partial(file_report, unit=unit, rate=rate)
    for index, result in isolated_map(work, files, workers=jobs, **_limits(files)):
        yield unread_report(files[index], REFUSED, result.reason) if isinstance(result, Failure) else result


def file_sections(
    files: Sequence[Path], *, jobs: int, unit: str | None = None, rate: float | None = None
) -> Iterator[tuple[Path, str]]:
    """Each file with its section of the HTML page, in order of completion; or the reason if it has none."""
    from kinemimic.pipeline.inspect.curves import section  # noqa: PLC0415 (see `file_section`)

    work = partial(file_section, unit=unit, rate=rate)
    for index, result in isolated_map(work, files, workers=jobs, **_limits(files)):
        file = files[index]
        if isinstance(result, Failure):
            yield file, section(InspectedFile(unread_report(file, REFUSED, result.reason)))
        else:
            yield file, result


def file_section(path: Path, *, unit: str | None = None, rate: float | None = None) -> str:
    """The section of one file on the HTML page."""
    # Importing matplotlib takes longer than reading most captures.
    from kinemimic.pipeline.inspect.curves import section  # noqa: PLC0415

    return section(inspect_file(path, unit=unit, rate=rate))


def _limits(files: Sequence[Path]) -> dict[str, Any]:
    """Seconds and bytes allowed per file, for those of the largest.

    A depth recording is a folder of thousands of images. A long text needs several times its size in memory.
    """
    largest = max((_size(file) for file in files), default=0)
    seconds = TIMEOUT + _SECONDS_PER_BYTE * largest
    if any(file.is_dir() for file in files):
        seconds = max(seconds, 10.0 * TIMEOUT)
    if any(is_video(file) for file in files):
        seconds = max(seconds, _SECONDS_PER_VIDEO)
    return {"timeout": seconds, "memory": MEMORY + _MEMORY_PER_BYTE * largest}


def _size(file: Path) -> int:
    """Bytes of a regular file that is not larger than any capture; else 0."""
    try:
        found = file.stat()
    except OSError:
        return 0
    return found.st_size if stat.S_ISREG(found.st_mode) and found.st_size <= MAX_BYTES else 0


def mark_sidecar_files(reports: Iterable[Report]) -> list[Report]:
    """The reports sorted by file; files that were read with a capture get the status "sidecar".

    Of two files that name each other, the first is the capture.
    """
    in_order = sorted(reports, key=lambda report: Path(report["file"]).parts)
    sidecar_files: set[Path] = set()
    for report in in_order:
        file = Path(report["file"])
        if file not in sidecar_files:
            sidecar_files |= {beside(file, name) for name in report["sidecar_files"]}
    return [
        unread_report(Path(report["file"]), SIDECAR, "") | {"reason": None}
        if Path(report["file"]) in sidecar_files
        else report
        for report in in_order
    ]


def folder_summaries(reports: Sequence[Report]) -> list[dict[str, Any]]:
    """One record per folder, in the order of the reports.

    Medians are over the files that are not refused. repaired, flagged and refused count files; one file may
    be repaired for one defect and flagged for another.
    """
    groups: dict[str, list[Report]] = {}
    for report in reports:
        groups.setdefault(str(Path(report["file"]).parent), []).append(report)
    return [_folder_summary(name, group) for name, group in groups.items()]


def _folder_summary(name: str, group: Sequence[Report]) -> dict[str, Any]:
    captures = [report for report in group if report["status"] not in (OTHER, SIDECAR)]
    good = [report for report in captures if report["status"] != REFUSED]
    return {
        "folder": name,
        "captures": len(captures),
        "read": sum(report["read"] for report in captures),
        "frames": sum(report["frames"] for report in captures),
        "thigh_m": _median_of((report["bones_m"]["thigh"]["median"] for report in good), 4),
        "shank_m": _median_of((report["bones_m"]["shank"]["median"] for report in good), 4),
        "knee_peak_deg": _median_of((report["angles"]["knee_peak_deg"] for report in good), 2),
        "gait_period_s": _median_of((report["gait"]["period_s"] for report in good if report["gait"]), 3),
        "repaired": sum("repaired" in _actions(report) for report in captures),
        "flagged": sum("flagged" in _actions(report) for report in good),
        "refused": len(captures) - len(good),
        "sidecar_files": [Path(one["file"]).name for one in group if one["status"] == SIDECAR],
        "other": [Path(one["file"]).name for one in group if one["status"] == OTHER],
    }


def count_rules(reports: Iterable[Report], action: str) -> Counter[str]:
    """Per rule, the number of files in which it took this action."""
    return Counter(
        rule
        for report in reports
        for rule in {defect["rule"] for defect in report["defects"] if defect["action"] == action}
    )


def _actions(report: Report) -> set[str]:
    return {defect["action"] for defect in report["defects"]}


def _median_of(values: Iterable[float | None], digits: int) -> float | None:
    known = [value for value in values if value is not None]
    return round(median(known), digits) if known else None
