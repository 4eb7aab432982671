"""index.html of a folder of batches: a table to look through the data set, with figures and curves.

The page is self-contained: it opens from the disk and makes no network requests. Its rows are JSON
that a short script shows as the reader filters, so that thousands of captures open at once.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from kinemimic.evaluate.dataset.drawing import Drawing
from kinemimic.pipeline.cli.html import render
from kinemimic.pipeline.files.store import write_text
from kinemimic.retarget.dataset.split import SPLITS

# Key of a row -> the heading of its filter.
FILTERS: Mapping[str, str] = {
    "status": "status",
    "kind": "kind",
    "split": "split",
    "sensor": "sensor",
    "stage": "refused by",
    "verdict": "performed",
}
_SHOWN = (
    *FILTERS,
    *(
        "name",
        "subject",
        "format",
        "simulated",
        "cyclic",
        "reason",
        "licence",
        "frames",
        "rate_hz",
        "passes",
    ),
    *("complete", "defects", "findings", "strides_used", "period_s", "speed_m_s", "motion_frames"),
    *("motion_rate_hz", "upright", "knee_r2", "hip_r2", "mpjpe_mm", "unperformed"),
)


def write_page(path: Path, rows: Sequence[Mapping[str, Any]], drawings: Mapping[str, Drawing]) -> None:
    """Write the page about these rows of the index; drawings: of the motions, by name."""
    shown = []
    for row in rows:
        told = {key: _short(row.get(key)) for key in _SHOWN if row.get(key) not in (None, [], "")}
        if (drawn := drawings.get(row["name"])) is not None:
            told |= {"poses": drawn.poses, "curves": drawn.curves}
        if row.get("verdict") is not None:
            told["report"] = True
        shown.append(told)
    accepted = [row for row in rows if row["status"] == "accepted"]
    minutes = sum(row["motion_frames"] / row["motion_rate_hz"] for row in accepted if row.get("motion")) / 60
    tiles = [
        (str(len(rows)), "captures"),
        (str(len(accepted)), "accepted"),
        (str(len({row["subject"] for row in accepted})), "people"),
        (f"{minutes:.1f}", "minutes of motion"),
        *((str(sum(row["split"] == split for row in accepted)), split) for split in SPLITS),
    ]
    page = render(
        Path(__file__).with_name("templates") / "dataset.html",
        title=f"kinemimic: {path.resolve().parent.name}",
        folder=path.resolve().parent.name,
        tiles=tiles,
        simulated=sum(bool(row["simulated"]) for row in accepted),
        filters=[(key, name, _values(rows, key)) for key, name in FILTERS.items() if _values(rows, key)],
        # In a script, "<" could end it.
        rows=json.dumps(shown, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"),
    )
    write_text(path, page)


def _values(rows: Sequence[Mapping[str, Any]], key: str) -> list[str]:
    return sorted({row[key] for row in rows if row.get(key)})


def _short(value: Any) -> Any:
    return round(value, 3) if isinstance(value, float) else value
