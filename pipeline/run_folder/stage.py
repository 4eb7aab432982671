"""A stage of a run folder: its files appear together when it has succeeded, or not at all.

A stage writes into a staging folder. When it has succeeded, run.json announces its files, they are moved to
their places, and what was made from the files that they replace is set aside. If the process is killed in
between, the next command in the folder finishes the move.
"""

from __future__ import annotations

import logging
import os
import shutil
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.provenance import versions
from kinemimic.pipeline.files.stages import INDEX, STAGES, stage_named
from kinemimic.pipeline.files.store import remove_leftovers
from kinemimic.pipeline.run_folder.consistency import FolderState
from kinemimic.pipeline.run_folder.lock import locked
from kinemimic.pipeline.run_folder.record import (
    RUN_FILE,
    Entry,
    Pending,
    Record,
    digests,
    hashes,
    read_run_record,
    write_run_record,
)

OUTDATED = "outdated"
_STAGING = ".staging-{}"
_log = logging.getLogger(__name__)


@contextmanager
def stage(
    run: Path,
    name: str,
    *,
    sources: Mapping[str, Path] | None = None,
    adds: bool = False,
    unfinished: bool = False,
) -> Iterator[Path]:
    """Run a stage in a locked run folder; yields the folder into which the stage writes its files.

    name: a command, or a command and what it was asked for ("disturb room"), each of which has its own files.
    sources: files from outside the folder that the result depends on. adds: files that an earlier call wrote
    and this one does not are kept. unfinished: the stage does not count as up to date, so `run`
    repeats it.
    KinemimicError, before the block, if another process uses the folder, or if files that the stage reads do
    not belong together. If the block raises, the folder is unchanged.
    """
    reads = stage_named(name).reads
    with locked(run, make=not reads):
        record = recovered(run)
        state = FolderState(run, record)
        state.require(reads)
        _require_places(run, [file for file in stage_named(name).writes if "*" not in file])
        inputs = {file: state.sha256(file) for file in reads}
        staging = run / _STAGING.format(name.replace(" ", "-"))
        shutil.rmtree(staging, ignore_errors=True)
        try:
            staging.mkdir()
            yield staging
            files = sorted(
                path.relative_to(staging).as_posix() for path in staging.rglob("*") if path.is_file()
            )
            entry = Entry(
                inputs=inputs,
                outputs={file: sha for file, sha in hashes(staging, files).items() if sha is not None},
                version=versions().get("kinemimic"),
                sources=digests(sources or {}),
                unfinished=unfinished,
            )
            old = record.stages[name].outputs if name in record.stages else {}
            if adds:
                entry.outputs = {**old, **entry.outputs}
            _commit(run, record, name, entry, staging.name)
        except OSError as error:
            path = Path(os.fsdecode(error.filename or ""))
            if error.errno is None or not path.is_relative_to(staging):
                raise
            # The staging folder would mean nothing to the user.
            raise OSError(error.errno, error.strerror, str(run / path.relative_to(staging))) from None
        finally:
            shutil.rmtree(staging, ignore_errors=True)


@contextmanager
def reading(run: Path, name: str) -> Iterator[None]:
    """Hold a run folder whose files a command reads without writing any; raises what `stage` raises."""
    with locked(run, make=False):
        FolderState(run, recovered(run)).require(stage_named(name).reads)
        yield


def recovered(run: Path) -> Record:
    """The record of a locked run folder, after the move that a killed process left unfinished."""
    record = read_run_record(run)
    if record.pending is not None:
        record = _finish(run, record)
    for rest in run.glob(_STAGING.format("*")):
        shutil.rmtree(rest, ignore_errors=True)
    remove_leftovers(run / RUN_FILE)
    return record


def up_to_date(run: Path, name: str, *, sources: Mapping[str, Path], options: Mapping[str, Any]) -> bool:
    """Whether `run` ran the stage with these options on the files here, and its own are unchanged."""
    entry = recovered(run).stages.get(name)
    if entry is None or entry.unfinished or entry.options != dict(options):
        return False
    if entry.version != versions().get("kinemimic") or entry.sources != digests(sources):
        return False
    files = {**entry.inputs, **entry.outputs}
    return hashes(run, files) == files


def state_options(run: Path, name: str, options: Mapping[str, Any]) -> None:
    """Record the options with which `run` has run a stage."""
    record = read_run_record(run)
    entry = record.stages[name]
    entry.options = dict(options)
    write_run_record(run, record)


def _commit(run: Path, record: Record, name: str, entry: Entry, staging: str) -> None:
    """Announce the staged files in run.json, and move them to their places."""
    _require_places(run, entry.outputs)
    before = hashes(run, entry.outputs)
    # Of a stage that run.json does not know, all files that it can have written; but "view room" writes none
    # of the files of "view".
    unknown = stage_named(name).writes if " " not in name else ()
    old = set(record.stages[name].outputs) if name in record.stages else set(unknown)
    removed = sorted(file for file in old - set(entry.outputs) if (run / file).is_file())
    changed = [file for file, sha in entry.outputs.items() if before[file] not in (None, sha)]
    pending = Pending(
        stage=name,
        entry=entry,
        staging=staging,
        removed=removed,
        changed=[*changed, *removed],
        outdated=_next_free(run).name,
    )
    record.pending = pending
    write_run_record(run, record)
    _finish(run, record)


def _require_places(run: Path, files: Iterable[str]) -> None:
    """KinemimicError if something in the folder is in the way of a file: the move could not be finished."""
    for file in (*files, INDEX, f"{OUTDATED}/1/file"):
        target = run / file
        # A link is replaced, wherever it leads.
        if target.is_dir() and not target.is_symlink():
            raise KinemimicError(f"{target}: expected a file or nothing, found a folder; move it elsewhere")
        for folder in target.relative_to(run).parents:
            if os.path.lexists(run / folder) and not (run / folder).is_dir():
                raise KinemimicError(f"{run / folder}: expected a folder, found a file; move it elsewhere")


def _finish(run: Path, record: Record) -> Record:
    """Carry out the pending move; every step may have been done before."""
    pending = record.pending
    assert pending is not None  # noqa: S101 (narrows the type)
    for file in pending.entry.outputs:
        staged, target = run / pending.staging / file, run / file
        if staged.is_file():
            target.parent.mkdir(parents=True, exist_ok=True)
            staged.replace(target)
    for file in pending.removed:
        (run / file).unlink(missing_ok=True)
    result = record.with_stage(pending.stage, pending.entry)
    outdated = _outdated(run, result, pending)
    # The page about the folder links to files that go; what comes after a stage in evaluate/ writes it again.
    if pending.removed or any(outdated.values()):
        (run / INDEX).unlink(missing_ok=True)
    for name, files in outdated.items():
        _set_aside(run, files, run / OUTDATED / pending.outdated)
        result.stages.pop(name, None)
    write_run_record(run, result)
    shutil.rmtree(run / pending.staging, ignore_errors=True)
    if moved := [file for files in outdated.values() for file in files]:
        _log.warning(
            "%s: set aside what was made from %s: %s",
            run / OUTDATED / pending.outdated,
            # None has changed where a user deleted them.
            f"the earlier {_listed(pending.changed)}" if pending.changed else "files that are gone",
            _listed(moved),
        )
    return result


def _outdated(run: Path, record: Record, pending: Pending) -> dict[str, list[str]]:
    """Stage -> its files that were made from files which have been replaced, directly or through others."""
    new: dict[str, str | None] = {**dict.fromkeys(pending.removed), **pending.entry.outputs}
    replaced, found = set(pending.changed), dict[str, list[str]]()
    # Files of earlier versions, and those that were copied here, have no record.
    unrecorded = {
        one.name: [
            path.relative_to(run).as_posix()
            for file in one.writes
            for path in sorted(run.glob(file))
            if path.is_file() and record.writer(path.relative_to(run).as_posix()) is None
        ]
        for one in STAGES
    }

    def made_from_replaced(name: str) -> bool:
        if name == pending.stage:
            return False
        if name not in record.stages:
            return bool(unrecorded[name]) and not replaced.isdisjoint(stage_named(name).reads)
        inputs = record.stages[name].inputs
        return any(sha is not None and new.get(file, sha) != sha for file, sha in inputs.items())

    while more := [
        name for name in (*record.stages, *unrecorded) if name not in found and made_from_replaced(name)
    ]:
        for name in more:
            found[name] = [*record.stages[name].outputs] if name in record.stages else unrecorded[name]
            new |= dict.fromkeys(found[name])
            replaced |= set(found[name])
    return found


def _set_aside(run: Path, files: list[str], folder: Path) -> None:
    for file in files:
        if (run / file).exists():
            target = folder / file
            target.parent.mkdir(parents=True, exist_ok=True)
            (run / file).replace(target)


def _listed(files: list[str], most: int = 4) -> str:
    more = len(files) - most
    return ", ".join(files[:most]) + (f" and {more} more" if more > 0 else "")


def _next_free(run: Path) -> Path:
    """The first folder OUTDATED/1, OUTDATED/2, … that does not exist."""
    number = 1
    while (run / OUTDATED / str(number)).exists():
        number += 1
    return run / OUTDATED / str(number)
