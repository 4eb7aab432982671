"""Many files: which they are, their reports, and what they say together, folder by folder."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

from kinemimic.pipeline.inspect.file_report import (
    OTHER,
    REFUSED,
    SIDECAR,
    InspectedFile,
    file_report,
    inspect_file,
    unread_report,
)
from kinemimic.pipeline.parallel.task_pool import TIMEOUT, Failure, isolated_map
from kinemimic.pipeline.readers.depth.folder import is_recording

Report = dict[str, Any]


def find_files(paths: Iterable[Path]) -> list[Path]:
    """The files that are meant: a file is itself, a folder all files below it, hidden ones left out; a depth
    recording, which is a folder, counts as one file.

    In the sequence of their names, each once; a path that does not exist stays, and its report will say so.
    """
    found = {file: None for path in paths for file in (_below(path) if path.is_dir() else (path,))}
    return sorted(found, key=lambda file: file.parts)


def _below(folder: Path) -> Iterator[Path]:
    for place, folders, names in os.walk(folder):
        if is_recording(Path(place)):
            folders.clear()
            yield Path(place)
            continue
        folders[:] = [name for name in folders if not name.startswith(".")]
        yield from (Path(place) / name for name in names if not name.startswith("."))


def file_reports(files: Sequence[Path], *, jobs: int, unit: str | None = None) -> Iterator[Report]:
    """The report on each file as it is done, over a pool of processes: a damaged file costs only itself.

    unit: of length in all of them, as in `recognise.read`.
    """
    work = partial(file_report, unit=unit)
    for index, result in isolated_map(work, files, workers=jobs, timeout=_time_limit(files)):
        yield unread_report(files[index], REFUSED, result.reason) if isinstance(result, Failure) else result


def file_drawings(files: Sequence[Path], *, jobs: int, unit: str | None = None) -> Iterator[tuple[Path, str]]:
    """Each file with its part of the page of curves (HTML), likewise; or with the reason why it has none."""
    from kinemimic.pipeline.inspect.curves import section  # noqa: PLC0415 (see `draw`)

    work = partial(draw, unit=unit)
    for index, result in isolated_map(work, files, workers=jobs, timeout=_time_limit(files)):
        file = files[index]
        if isinstance(result, Failure):
            yield file, section(InspectedFile(unread_report(file, REFUSED, result.reason)))
        else:
            yield file, result


def draw(path: Path, *, unit: str | None = None) -> str:
    """One file's part of the page of curves (HTML)."""
    # matplotlib takes longer to load than most captures to read.
    from kinemimic.pipeline.inspect.curves import section  # noqa: PLC0415

    return section(inspect_file(path, unit=unit))


def _time_limit(files: Sequence[Path]) -> float:
    """Seconds for one of the files: a depth recording is a folder of thousands of images."""
    return 10.0 * TIMEOUT if any(file.is_dir() for file in files) else TIMEOUT


def mark_sidecar_files(reports: Iterable[Report]) -> list[Report]:
    """The reports in the sequence of their files, those companions told that some capture was read with.

    Of two files that name each other, the first is the capture.
    """
    in_sequence = sorted(reports, key=lambda report: Path(report["file"]).parts)
    companions: set[Path] = set()
    for report in in_sequence:
        file = Path(report["file"])
        if file not in companions:
            companions |= {file.with_name(name) for name in report["companions"]}
    return [
        unread_report(Path(report["file"]), SIDECAR, "") | {"reason": None}
        if Path(report["file"]) in companions
        else report
        for report in in_sequence
    ]


def folder_summaries(reports: Sequence[Report]) -> list[dict[str, Any]]:
    """One record for each folder, in the sequence of the reports.

    Medians are over the files that are not refused; repaired, flagged and refused count files: one file may
    be repaired in one thing and flagged for another.
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
        "companions": [Path(one["file"]).name for one in group if one["status"] == SIDECAR],
        "other": [Path(one["file"]).name for one in group if one["status"] == OTHER],
    }


def count_rules(reports: Iterable[Report], action: str) -> Counter[str]:
    """For each rule, the number of files in which it took this action."""
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
