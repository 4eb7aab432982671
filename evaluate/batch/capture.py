"""One capture of a batch: its stages, in its run folder, and the row with their outcome."""

from __future__ import annotations

import errno
import shutil
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from kinemimic.evaluate.batch.row import (
    FAILED,
    capture_columns,
    empty_row,
    motion_columns,
    score_columns,
)
from kinemimic.evaluate.batch.state import Kept
from kinemimic.evaluate.batch.task import TRACKER, CaptureTask, Row, made_from
from kinemimic.evaluate.workflow.run import run
from kinemimic.pipeline.errors import KinemimicError, NotACaptureError, one_line
from kinemimic.pipeline.files.sidecars import beside
from kinemimic.pipeline.files.stages import STAGES, stage_named
from kinemimic.pipeline.files.store import read_json
from kinemimic.pipeline.inspect.file_report import OTHER, REFUSED
from kinemimic.pipeline.run_folder.lock import locked
from kinemimic.pipeline.run_folder.record import RUN_FILE
from kinemimic.pipeline.run_folder.stage import OUTDATED
from kinemimic.retarget.formats.gait_json import read_gait_json

# Nothing is wrong with a capture that met these.
_NO_SPACE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
# Of a performance, what the row and the report do not need, and `run` makes again: 12 MB of 14.
_LARGE = ("policy.safetensors", "trajectory.npz")
_IN_USE = "its run folder is in use by another process; run the batch again when that process has ended"
_PATIENCE = 10.0  # seconds that the process of a batch which was killed may take to end


def process(task: CaptureTask) -> Kept:
    """Run the stages on a capture; a refusal is a row with its reason.

    Outputs of an earlier run are removed first, unless the task goes on with it, so that no old motion stands
    beside a refusal. A run folder that another process holds stays as it is.
    """
    begin = time.perf_counter()
    with ExitStack() as held:
        try:
            held.enter_context(_patiently(task.folder))
        except KinemimicError:
            return Kept(empty_row(task, FAILED, _IN_USE), {})
        if not task.resume:
            clear(task.folder)
        row = _row(task)
        if row["status"] == FAILED:
            clear(task.folder)
        made = made_from(task)
    inputs = {name: mark[2] for name, mark in made["inputs"].items() if mark is not None}
    if task.capture.is_file():
        row["sha256"] = inputs.pop(task.capture.name, None)
        row["sidecar_files"] = [name for name in inputs if beside(task.capture, name).exists()]
    row["seconds"] = round(time.perf_counter() - begin, 2)
    return Kept(row, {} if row["status"] == FAILED else made)


def _row(task: CaptureTask) -> Row:
    motion = tuple(stage for stage in task.stages if stage != "evaluate")
    options = {stage: task.options.get(stage, {}) for stage in motion}
    try:
        run(task.capture, task.folder, options=options, stages=motion, quiet=True)
    except NotACaptureError as error:
        return empty_row(task, OTHER, str(error))
    except (KinemimicError, OSError) as error:
        full = isinstance(error, OSError) and error.errno in _NO_SPACE
        row = empty_row(task, FAILED if full else REFUSED, one_line(error))
        return row | capture_columns(task.folder) | {"stage": _unfinished(task.folder, motion)}
    row = empty_row(task, "accepted", "") | capture_columns(task.folder)
    if "retarget" in motion:
        row |= motion_columns(read_gait_json(task.folder / "gait.json"))
    if "evaluate" in task.stages and row["status"] == "accepted":
        row |= _performed(task)
    return row


def _performed(task: CaptureTask) -> Row:
    """The scores of the motion as the tracker performs it, or why it does not."""
    try:
        scores = run(
            task.capture, task.folder, options=task.options, stages=task.stages, policy=TRACKER, quiet=True
        ).scores
    except KinemimicError as error:
        return {"unperformed": empty_row(task, "", one_line(error))["reason"]}
    except OSError as error:
        status = FAILED if error.errno in _NO_SPACE else "accepted"
        reason = empty_row(task, status, one_line(error))["reason"]
        return {"status": status, "reason": reason} if status == FAILED else {"unperformed": reason}
    for name in _LARGE:
        (task.folder / name).unlink(missing_ok=True)
    return score_columns(scores or read_json(task.folder / "scores.json"))


def clear_if_free(folder: Path) -> None:
    """`clear` a run folder if there is one, and no other process holds it."""
    if folder.is_dir():
        with suppress(KinemimicError, OSError), locked(folder):
            clear(folder)


def clear(folder: Path) -> None:
    """Remove what the stages, and a process that was killed in one of them, left in a run folder.

    The caller must hold its lock.
    """
    for name in (RUN_FILE, "index.html", *(file for stage in STAGES for file in stage.writes)):
        for file in (*folder.glob(name), *folder.glob(f".{name}.*")):
            file.unlink(missing_ok=True)
    for rest in (*folder.glob(".staging-*"), folder / OUTDATED):
        shutil.rmtree(rest, ignore_errors=True)


@contextmanager
def _patiently(folder: Path) -> Iterator[None]:
    """`locked`, but wait for a process that has been killed and is not yet gone."""
    deadline = time.monotonic() + _PATIENCE
    with ExitStack() as stack:
        while True:
            try:
                stack.enter_context(locked(folder))
                break
            except KinemimicError:
                if time.monotonic() > deadline:
                    raise
                time.sleep(0.1)
        yield


def _unfinished(folder: Path, stages: tuple[str, ...]) -> str | None:
    """The first stage without its output."""
    missing = (name for name in stages if not (folder / stage_named(name).writes[0]).exists())
    return next(missing, None)
