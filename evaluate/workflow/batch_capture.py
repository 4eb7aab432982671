"""One capture of a batch: its stages up to the motion, and the row that says what became of it.

The row is also kept in the capture's run folder, with what it was made from (batch_row.json), so that the
next batch can skip the capture.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kinemimic.evaluate.workflow.run import RUN_STAGES, run
from kinemimic.pipeline.errors import KinemimicError, NotACaptureError
from kinemimic.pipeline.files.provenance import versions
from kinemimic.pipeline.files.stages import stage_named
from kinemimic.pipeline.files.store import read_json, write_json
from kinemimic.pipeline.inspect.file_report import OTHER, REFUSED, without_path
from kinemimic.pipeline.run_folder.capture import sources_of
from kinemimic.pipeline.run_folder.record import RUN_FILE, digests
from kinemimic.retarget.formats.gait_json import read_gait_json

ROW, ROW_SCHEMA = "batch_row.json", 1
ACCEPTED, FAILED, GATE = "accepted", "failed", "gate"
TO_MOTION = RUN_STAGES[: RUN_STAGES.index("retarget") + 1]
_OUTPUTS = (RUN_FILE, ROW, *(file for name in TO_MOTION for file in stage_named(name).writes))
_KEPT_OUTPUTS = ("motion.json", "gait.json")

Row = dict[str, Any]


@dataclass(frozen=True)
class Task:
    """A capture, its run folder, and the options of the stages, as `run` takes them."""

    capture: Path
    folder: Path
    options: Mapping[str, Mapping[str, Any]]


def process(task: Task) -> Row:
    """Run the stages up to the motion on a capture; a refusal is a row with its reason.

    Outputs of an earlier run are removed first, so that no old motion stands beside a refusal.
    """
    begin = time.perf_counter()
    for name in _OUTPUTS:
        (task.folder / name).unlink(missing_ok=True)
    try:
        run(task.capture, task.folder, options=task.options, stages=TO_MOTION, quiet=True)
    except NotACaptureError as error:
        return _empty_row(task, OTHER, str(error))
    except (KinemimicError, OSError) as error:
        row = _empty_row(task, REFUSED, _text(error)) | {"stage": _unfinished(task.folder)}
    else:
        row = motion_row(task, read_gait_json(task.folder / "gait.json"))
    made_from = _made_from(task)
    inputs = {name: digest for name, digest in made_from["inputs"].items() if digest}
    if task.capture.is_file():
        row["sha256"] = inputs.pop(task.capture.name, None)
        row["sidecar_files"] = [name for name in inputs if task.capture.with_name(name).exists()]
    row["seconds"] = round(time.perf_counter() - begin, 2)
    write_json(task.folder / ROW, {"schema": ROW_SCHEMA, **made_from, "row": row})
    return row


def remove_partial(task: Task) -> None:
    """Remove the temporary files (`files.store.atomic`) that a killed process left in the run folder."""
    for name in _OUTPUTS:
        for file in task.folder.glob(f".{name}.*"):
            file.unlink()


def kept_row(task: Task) -> Row | None:
    """The row of an earlier batch, if capture, options, version and the motion are still the same."""
    path = task.folder / ROW
    if not path.exists():
        return None
    try:
        kept = read_json(path)
        made_from = {key: kept[key] for key in ("schema", "inputs", "config", "version", "outputs")}
        row: Row = kept["row"]
    except (KinemimicError, KeyError, TypeError):
        return None
    return row if made_from == {"schema": ROW_SCHEMA, **_made_from(task)} else None


def failed_row(task: Task, reason: str) -> Row:
    """The row of a capture whose process crashed or took too long; the next batch tries it again."""
    return _empty_row(task, FAILED, reason)


def _empty_row(task: Task, status: str, reason: str) -> Row:
    """The row of a capture without a motion: all keys, with these values."""
    for place in (task.capture, task.folder):
        reason = without_path(place, reason)
    return {
        "file": str(task.capture),
        "folder": str(task.folder),
        "sha256": None,
        "sidecar_files": [],
        "status": status,
        "stage": None,
        "kind": None,
        "cyclic": None,
        "strides_used": None,
        "strides_found": None,
        "period_s": None,
        "speed_m_s": None,
        "path": None,
        "path_disagreement": None,
        "findings": [],
        "reason": reason or None,
        "seconds": None,
    }


def motion_row(task: Task, gait: Mapping[str, Any]) -> Row:
    """The row of a motion, from gait.json."""
    refusals = [finding["message"] for finding in gait["gate"] if finding["severity"] == "refuse"]
    path = gait.get("path") or {}
    return _empty_row(task, REFUSED if refusals else ACCEPTED, "; ".join(refusals)) | {
        "stage": GATE if refusals else None,
        "kind": gait["kind"],
        "cyclic": gait["cyclic"],
        "strides_used": gait.get("strides_used", gait.get("strides")),
        "strides_found": gait.get("strides_found"),
        "period_s": gait.get("period_s"),
        "speed_m_s": gait.get("speed_m_s"),
        "path": path.get("source"),
        "path_disagreement": path.get("disagreement"),
        "findings": [text for text in gait["warnings"] if text not in refusals],
    }


def _made_from(task: Task) -> dict[str, Any]:
    config = {stage: dict(options) for stage, options in task.options.items()}
    return {
        "inputs": digests(sources_of(task.folder, task.capture)),
        "config": config,
        "version": versions().get("kinemimic"),
        "outputs": digests({name: task.folder / name for name in _KEPT_OUTPUTS}),
    }


def _unfinished(folder: Path) -> str | None:
    """The first stage without its output."""
    missing = (name for name in TO_MOTION if not (folder / stage_named(name).writes[0]).exists())
    return next(missing, None)


def _text(error: Exception) -> str:
    if isinstance(error, OSError):
        return f"{error.filename}: {(error.strerror or str(error)).lower()}"
    return str(error)
