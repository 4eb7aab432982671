"""Many files: which they are, their reports, and what they say together, folder by folder."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from kinemimic.pipeline.inspect.pool import Lost, Work, each
from kinemimic.pipeline.inspect.study import COMPANION, OTHER, REFUSED, look_at, unread

Report = dict[str, Any]


def files_of(paths: Iterable[Path]) -> list[Path]:
    """The files that are meant: a file is itself, a folder all files below it, hidden ones left out.

    In the sequence of their names, each once; a path that does not exist stays, and its report will say so.
    """
    found = {file: None for path in paths for file in (_below(path) if path.is_dir() else (path,))}
    return sorted(found, key=lambda file: file.parts)


def _below(folder: Path) -> Iterator[Path]:
    for place, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if not name.startswith(".")]
        yield from (Path(place) / name for name in names if not name.startswith("."))


@dataclass(frozen=True)
class Looked:
    """A file's report, and its drawings as HTML where they were asked for."""

    report: Report
    drawings: str = ""


def look(path: Path, *, draw: bool = False) -> Looked:
    """One file, looked at."""
    studied = look_at(path)
    if not draw:
        return Looked(studied.report)
    # matplotlib takes longer to load than most captures to read.
    from kinemimic.pipeline.inspect.curves import section  # noqa: PLC0415

    return Looked(studied.report, section(studied))


def survey(files: Sequence[Path], work: Work, *, jobs: int) -> Iterator[Looked]:
    """work(file) of each file as it is done, over a pool of processes; work: `look`, or a part of it.

    A file for which there is no result has the reason in its report.
    """
    for index, result in each(work, files, jobs=jobs):
        lost = isinstance(result, Lost)
        yield Looked(unread(files[index], REFUSED, result.reason)) if lost else result


def with_companions(reports: Iterable[Report]) -> list[Report]:
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
        unread(Path(report["file"]), COMPANION, "") | {"reason": None}
        if Path(report["file"]) in companions
        else report
        for report in in_sequence
    ]


def folders(reports: Sequence[Report]) -> list[dict[str, Any]]:
    """One record for each folder, in the sequence of the reports.

    Medians are over the files that are not refused; repaired, flagged and refused count files: one file may
    be repaired in one thing and flagged for another.
    """
    groups: dict[str, list[Report]] = {}
    for report in reports:
        groups.setdefault(str(Path(report["file"]).parent), []).append(report)
    return [_folder(name, group) for name, group in groups.items()]


def _folder(name: str, group: Sequence[Report]) -> dict[str, Any]:
    captures = [report for report in group if report["status"] not in (OTHER, COMPANION)]
    good = [report for report in captures if report["status"] != REFUSED]
    return {
        "folder": name,
        "captures": len(captures),
        "read": sum(report["read"] for report in captures),
        "frames": sum(report["frames"] for report in captures),
        "thigh_m": _middle((report["bones_m"]["thigh"]["median"] for report in good), 4),
        "shank_m": _middle((report["bones_m"]["shank"]["median"] for report in good), 4),
        "knee_peak_deg": _middle((report["angles"]["knee_peak_deg"] for report in good), 2),
        "gait_period_s": _middle((report["gait"]["period_s"] for report in good if report["gait"]), 3),
        "repaired": sum("repaired" in _actions(report) for report in captures),
        "flagged": sum("flagged" in _actions(report) for report in good),
        "refused": len(captures) - len(good),
        "companions": [Path(one["file"]).name for one in group if one["status"] == COMPANION],
        "other": [Path(one["file"]).name for one in group if one["status"] == OTHER],
    }


def rule_counts(reports: Iterable[Report], action: str) -> Counter[str]:
    """For each rule, the number of files in which it took this action."""
    return Counter(
        rule
        for report in reports
        for rule in {defect["rule"] for defect in report["defects"] if defect["action"] == action}
    )


def _actions(report: Report) -> set[str]:
    return {defect["action"] for defect in report["defects"]}


def _middle(values: Iterable[float | None], digits: int) -> float | None:
    known = [value for value in values if value is not None]
    return round(median(known), digits) if known else None
