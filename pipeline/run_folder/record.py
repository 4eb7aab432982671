"""run.json: which stage wrote which file of a run folder, from what.

The record tells whether a stage is up to date, and whether the files in a folder belong together.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path, PurePosixPath
from typing import Any

from msgspec import Struct, field, to_builtins
from msgspec.structs import replace

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import file_hash, read_json, write_json
from kinemimic.pipeline.files.validation.records import convert

RUN_FILE = "run.json"
RUN_SCHEMA = 2


class Entry(Struct, forbid_unknown_fields=True, omit_defaults=True):
    """A finished stage.

    inputs: file of the folder -> SHA-256, None if it was absent; sources: the same for files from elsewhere
    (the capture and its sidecar files); outputs: file -> SHA-256; version: of kinemimic; options: as given
    to `run`, None if the stage was not run by it; unfinished: training has not reached its end.
    """

    inputs: dict[str, str | None] = field(default_factory=dict)
    outputs: dict[str, str] = field(default_factory=dict)
    version: str | None = None
    sources: dict[str, str | None] = field(default_factory=dict)
    options: dict[str, Any] | None = None
    unfinished: bool = False


class Pending(Struct, forbid_unknown_fields=True):
    """A stage whose files are complete and are being moved to their places.

    staging: the folder that they come from; removed: files of the folder that it replaces by nothing;
    outdated: folder for what was made from the replaced files; changed: files that it replaces.
    """

    stage: str
    entry: Entry
    staging: str
    removed: list[str]
    changed: list[str]
    outdated: str


class Record(Struct, forbid_unknown_fields=True, omit_defaults=True):
    """The content of run.json."""

    schema: int = RUN_SCHEMA
    stages: dict[str, Entry] = field(default_factory=dict)
    pending: Pending | None = None

    def writer(self, file: str) -> str | None:
        """The stage that wrote a file, or None if no stage recorded here did."""
        return next((name for name, entry in self.stages.items() if file in entry.outputs), None)

    def with_stage(self, name: str, entry: Entry) -> Record:
        """A record in which the stage is the last one, and the only one that wrote its outputs."""
        stages = {
            other: replace(
                old, outputs={file: sha for file, sha in old.outputs.items() if file not in entry.outputs}
            )
            for other, old in self.stages.items()
            if other != name
        }
        return Record(stages={**{other: old for other, old in stages.items() if old.outputs}, name: entry})


def read_run_record(run: Path) -> Record:
    """Read run.json; a missing one, or one of an earlier schema, counts as empty.

    KinemimicError for a damaged one and for one of a later version.
    """
    path = run / RUN_FILE
    if not path.exists():
        return Record()
    advice = "delete it if you trust the files beside it"
    content = read_json(path)
    schema = content.get("schema") if isinstance(content, dict) else None
    if type(schema) is int and 0 <= schema < RUN_SCHEMA:
        return Record()
    if type(schema) is int and schema > RUN_SCHEMA:
        raise KinemimicError(
            f"{path}: expected the record of a run folder of schema {RUN_SCHEMA}, found {schema}, written by "
            "a later version of kinemimic; install that version, or choose another --run"
        )
    record = convert(content, Record, path, advice=advice)
    # These names are moved and removed.
    for name in _files(record):
        if not _inside(name):
            raise KinemimicError(f"{path}: expected files of this folder, found {name!r:.80}; {advice}")
    for name in (one for entry in record.stages.values() for one in entry.sources):
        # A capture's sidecar files may be in a folder beside its own.
        if not _inside(name.removeprefix("../")):
            raise KinemimicError(f"{path}: expected files beside a capture, found {name!r:.80}; {advice}")
    return record


def write_run_record(run: Path, record: Record) -> None:
    """Write run.json."""
    write_json(run / RUN_FILE, to_builtins(record) | {"schema": RUN_SCHEMA})


def hashes(folder: Path, names: Iterable[str]) -> dict[str, str | None]:
    """File of the folder -> SHA-256, or None if there is none."""
    return {name: digest(folder / name) for name in names}


def digest(path: Path) -> str | None:
    """SHA-256 of a file, or None if there is none."""
    return file_hash(path) if path.is_file() else None


def digests(files: Mapping[str, Path]) -> dict[str, str | None]:
    """Name -> SHA-256 of files anywhere."""
    return {name: digest(path) for name, path in files.items()}


def _files(record: Record) -> Iterable[str]:
    entries = list(record.stages.values())
    if record.pending is not None:
        pending = record.pending
        entries.append(pending.entry)
        yield from (*pending.removed, *pending.changed, pending.staging, pending.outdated)
    for entry in entries:
        yield from entry.outputs
        yield from entry.inputs


def _inside(name: str) -> bool:
    path = PurePosixPath(name)
    return bool(path.parts) and not path.is_absolute() and ".." not in path.parts and "\0" not in name
