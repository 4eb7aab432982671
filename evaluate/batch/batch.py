"""`kinemimic batch`: the motions of many captures as a data set, and a table with the outcome of each.

Every capture has its run folder below the output folder and is processed by itself, with limited time and
memory, so that a damaged capture costs only its own row.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from kinemimic.evaluate.batch.sources import paths_of, run_folders
from kinemimic.evaluate.batch.state import BatchState, place_of
from kinemimic.evaluate.batch.task import CaptureTask, Row
from kinemimic.evaluate.batch.work import BatchWork
from kinemimic.evaluate.workflow.start import for_tracker
from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.provenance import provenance
from kinemimic.pipeline.files.store import write_json, write_text
from kinemimic.pipeline.parallel.executor import Executor, LocalProcesses
from kinemimic.pipeline.plural import plural
from kinemimic.retarget.dataset.split import subject_pattern

BATCH_SCHEMA = 1
TIMEOUT = 300.0
MEMORY_GIB = 4.0
# Names in the output folder that no run folder may take.
_RESERVED = ("dataset", "index.html", "batch.json", "batch.csv", "batch.sqlite")


def batch(
    sources: Sequence[str | Path],
    out: Path,
    *,
    options: Mapping[str, Mapping[str, Any]] | None = None,
    to: str = "motion",
    subject: str | None = None,
    executor: Executor | None = None,
    jobs: int = 1,
    timeout: float = TIMEOUT,
    memory: float = MEMORY_GIB,
    overwrite: bool = False,
    dataset: bool = True,
) -> dict[str, Any]:
    """Process all captures at `sources` below `out`; writes batch.json, batch.csv and the data set.

    sources: as `paths_of` takes them; options: stage -> its command's options, as `workflow.run` takes them;
    to: "clip", "motion", or "performed", by the tracker that ships and with scores; subject: regular
    expression of the person in a file's name (`dataset.subject`); executor: what runs the tasks, by
    default `jobs` processes, each capture with `timeout` seconds and `memory` GiB; overwrite: also process
    captures whose result is up to date; dataset: also write the data set and its page, of everything in
    `out`, with what other batches made there.
    Returns the content of batch.json, which is about the captures of this call. A capture that is refused,
    crashes, or takes too long or too much is a row with the reason. An interrupted batch writes the rows of
    the captures that are finished; called again, it resumes with the others. KinemimicError for a source
    that does not exist.
    """
    subject_pattern(subject)  # an invalid one is refused before the captures are processed
    given = for_tracker(options or {}) if to == "performed" else options or {}
    config = {stage: dict(chosen) for stage, chosen in given.items() if chosen}
    folders = run_folders(paths_of(sources), out)
    if not folders:
        return _result([], config)
    executor = executor or LocalProcesses(jobs, timeout, int(memory * 2**30))
    with BatchState(out) as state:
        names = state.names({file: _free(folder.relative_to(out)) for file, folder in folders.items()})
        tasks = [CaptureTask(file, out / names[file], config, to, names[file]) for file in folders]
        work = BatchWork(tasks, state, overwrite=overwrite)
        try:
            with progress("batch", len(work.waiting), unit="captures") as bar:
                work.carry_out(executor, lambda task: bar.advance(finished=task.capture.name))
        except KeyboardInterrupt:
            _interrupted(tasks, work, out, config)
            raise KeyboardInterrupt(
                f"{out}: {len(work.rows)} of {len(tasks)} files done; run the same command again to resume"
            ) from None
        result = _write(out, [work.rows[task.name] for task in tasks], config)
        if dataset:
            from kinemimic.evaluate.dataset.build import refresh  # noqa: PLC0415 (import cost)

            state.forget(_gone(sources, state))
            refresh(out, state, subject=subject)
    return result


def _free(folder: Path) -> str:
    """The name of a run folder; not one that a file of the batch has."""
    first, *rest = folder.parts
    return Path(f"{first}_" if first in _RESERVED else first, *rest).as_posix()


def _gone(sources: Sequence[str | Path], state: BatchState) -> list[str]:
    """Names of captures that were in a folder which this batch has searched, and are not there any more."""
    searched = [place_of(path) for path in paths_of(sources) if path.is_dir()]
    return [
        name
        for name, (capture, _) in state.rows().items()
        if any(place_of(capture).is_relative_to(folder) for folder in searched) and not capture.exists()
    ]


def _interrupted(tasks: Sequence[CaptureTask], work: BatchWork, out: Path, config: Mapping[str, Any]) -> None:
    """Write the rows of the captures that are finished, and remove what is left of those that were begun."""
    from kinemimic.evaluate.batch.capture import clear_if_free  # noqa: PLC0415 (import cost)

    for task in tasks:
        if task.name not in work.rows and work.is_mine(task):
            clear_if_free(task.folder)
    _write(out, [work.rows[task.name] for task in tasks if task.name in work.rows], config)


def _write(out: Path, rows: Sequence[Row], config: Mapping[str, Any]) -> dict[str, Any]:
    """Write batch.json and batch.csv, unless they are the same; returns the content of batch.json."""
    from kinemimic.evaluate.batch.table import rows_csv  # noqa: PLC0415 (import cost)

    result = _result(rows, config)
    if rows:
        write_json(out / "batch.json", result)
        write_text(out / "batch.csv", rows_csv(result["captures"]))
    return result


def _result(rows: Sequence[Row], config: Mapping[str, Any]) -> dict[str, Any]:
    from kinemimic.evaluate.batch.table import captures_among, counts  # noqa: PLC0415 (import cost)

    read, other = captures_among(rows)
    return {
        "schema": BATCH_SCHEMA,
        "counts": counts(read),
        "captures": read,
        "other": {row["file"]: row["reason"] for row in other},
        "provenance": provenance(
            "batch",
            inputs={row["file"]: row["sha256"] for row in read if row["sha256"]},
            config=config,
        ),
    }


def found_nothing(sources: Sequence[str | Path], result: Mapping[str, Any]) -> KinemimicError:
    """The error about sources without a capture."""
    reasons = list(result["other"].values()) or ["it is empty"]
    more = ""
    if (others := len(reasons) - 1) > 0:
        what = "is not a capture" if others == 1 else "are not captures"
        more = f"; {plural(others, 'other file')} {what} either"
    return KinemimicError(f"{os.fspath(sources[0])}: expected captures, found none: {reasons[0]}{more}")
