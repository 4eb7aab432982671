"""The card of a data set: README.md with its numbers, in the layout that Hugging Face's hub reads."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from kinemimic.pipeline.files.provenance import versions
from kinemimic.pipeline.files.store import write_text
from kinemimic.retarget.dataset.columns import CARD, FRAME_COLUMNS, INDEX, INDEX_COLUMNS, MOTIONS, SUMS
from kinemimic.retarget.dataset.split import SPLITS

_UNKNOWN = "unknown"
_MOST = 20  # lines of a table


def write_card(folder: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write README.md for these rows of the index."""
    write_text(folder / CARD, "\n".join(_lines(rows)) + "\n")


def _lines(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    motions = [row for row in rows if row["motion"] is not None]
    present = [split for split in SPLITS if any(row["split"] == split for row in motions)]
    yield from _front_matter(present)
    accepted = [row for row in rows if row["status"] == "accepted"]
    simulated = sum(bool(row["simulated"]) for row in accepted)
    yield from (
        "# Motions",
        "",
        f"{len(rows)} captures, of which {len(accepted)} are accepted. {len(motions)} motions of "
        f"{len({row['subject'] for row in motions})} people on one humanoid body: "
        f"{sum(row['motion_frames'] for row in motions)} frames, {_minutes(motions):.1f} minutes"
        + (f"; {simulated} of the accepted captures are simulated (virtual Kinect)." if simulated else "."),
        "",
        f"Made by kinemimic {versions().get('kinemimic', _UNKNOWN)}. `{INDEX}` has a row for every capture, "
        f"including those that were refused. `{MOTIONS}/` has the frames of the motions. "
        f"`sha256sum --check {SUMS}` verifies the files.",
        "",
        "## Splits",
        "",
        "By person, drawn by the hash of the person's name: no person is in two splits.",
        "",
    )
    yield from _table(
        ("split", "people", "motions", "minutes"),
        [
            (
                split,
                len({row["subject"] for row in motions if row["split"] == split}),
                sum(row["split"] == split for row in motions),
                f"{_minutes([row for row in motions if row['split'] == split]):.1f}",
            )
            for split in SPLITS
        ],
    )
    yield from (
        "",
        "## Licences",
        "",
        "Each motion has the licence of its capture; where that is unknown, ask the capture's owner.",
        "",
    )
    yield from _counted("licence", rows)
    yield from ("", "## What is in it", "")
    for column in ("status", "kind", "sensor", "format", "stage"):
        yield from _counted(column, [row for row in rows if column != "stage" or row["stage"]])
        yield ""
    yield from _scores(rows)
    for title, columns in ((INDEX, INDEX_COLUMNS), (f"{MOTIONS}/*.parquet", FRAME_COLUMNS)):
        yield from (f"## Columns of {title}", "")
        yield from _table(
            ("column", "type", "meaning"),
            [
                (f"`{name}`", str(kind).replace("element: ", ""), text)
                for name, (kind, text) in columns.items()
            ],
        )
        yield ""


def _minutes(motions: Sequence[Mapping[str, Any]]) -> float:
    return float(sum(row["motion_frames"] / row["motion_rate_hz"] for row in motions)) / 60.0


def _front_matter(present: Sequence[str]) -> Iterator[str]:
    yield from (
        "---",
        "license: other",
        "license_name: those-of-the-captures",
        "tags:",
        "- motion-capture",
        "configs:",
    )
    if present:
        yield from ("- config_name: motions", "  default: true", "  data_files:")
        for split in present:
            yield from (f"  - split: {split}", f"    path: {MOTIONS}/{split}-*.parquet")
    yield from ("- config_name: index", "  data_files:", "  - split: all", f"    path: {INDEX}", "---", "")


def _scores(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    scored = [row for row in rows if row["verdict"] is not None]
    if not scored:
        return
    yield from ("## Performed by the tracker", "")
    yield from _counted("verdict", scored)
    yield ""
    columns = ("upright", "knee_r2", "hip_r2", "knee_rmse_deg", "hip_rmse_deg", "mpjpe_mm")
    known = {name: [row[name] for row in scored if row[name] is not None] for name in columns}
    yield from _table(
        ("score", "median of the motions"),
        [(f"`{name}`", f"{median(values):.3g}") for name, values in known.items() if values],
    )
    yield ""


def _counted(column: str, rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    counted = sorted(
        Counter(row[column] or _UNKNOWN for row in rows).items(), key=lambda item: (-item[1], item[0])
    )
    shown = counted[:_MOST]
    if len(counted) > _MOST:
        shown.append((f"{len(counted) - _MOST} others", sum(count for _, count in counted[_MOST:])))
    if shown:
        yield from _table((column, "captures"), shown)


def _table(head: Sequence[str], rows: Iterable[Sequence[Any]]) -> Iterator[str]:
    yield f"| {' | '.join(head)} |"
    yield f"|{'---|' * len(head)}"
    for row in rows:
        yield f"| {' | '.join(_cell(value) for value in row)} |"


def _cell(value: Any) -> str:
    """Text of a file, which must not end the cell or begin markup."""
    return " ".join(str(value).split()).replace("|", "\\|").replace("<", "&lt;")
