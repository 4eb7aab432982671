"""A capture of a batch for an executor that shares no disk: files go there and come back as bytes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from kinemimic.evaluate.batch.capture import clear, process
from kinemimic.evaluate.batch.state import Kept
from kinemimic.evaluate.batch.task import CaptureTask, Row, made_from
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.parallel.packed_files import PackedFiles, read_files, read_folder, write_files
from kinemimic.pipeline.readers.search import files_to_read
from kinemimic.pipeline.run_folder.lock import locked
from kinemimic.pipeline.run_folder.record import RUN_FILE


@dataclass(frozen=True)
class Packed:
    """A task without its run folder.

    capture: name of the file, or of the folder; in_folder: whether it is one; files: of the capture and
    beside it; options, to: as in `CaptureTask`.
    """

    name: str
    capture: str
    in_folder: bool
    files: PackedFiles
    options: Mapping[str, Mapping[str, Any]]
    to: str


@dataclass(frozen=True)
class Processed:
    """The row of a packed task, whose paths are those of its own machine, and the files of its run folder."""

    row: Row
    files: PackedFiles


def pack(task: CaptureTask) -> Packed:
    """The task with the bytes of its files; OSError for a file that cannot be read, KinemimicError for too
    much to send."""
    files = read_files(files_to_read(task.capture))
    return Packed(task.name, task.capture.name, task.capture.is_dir(), files, task.options, task.to)


def process_packed(packed: Packed) -> Processed:
    """Carry out a task in a temporary folder of this machine."""
    with TemporaryDirectory(prefix="kinemimic-") as place:
        capture, folder = Path(place) / "in" / packed.capture, Path(place) / "out"
        write_files(capture if packed.in_folder else capture.parent, packed.files)
        row = process(CaptureTask(capture, folder, packed.options, packed.to, packed.name)).row
        # A capture of which nothing came has no run folder.
        return Processed(row, read_folder(folder) if folder.exists() else {})


def unpack(task: CaptureTask, processed: Processed) -> Kept:
    """Write the run folder of a task that was carried out elsewhere; its record comes last.

    KinemimicError for files that cannot be of a run folder; OSError where one cannot be written. Neither
    leaves a part of the results.
    """
    with locked(task.folder):
        clear(task.folder)
        try:
            write_files(task.folder, processed.files, last=lambda name: name == RUN_FILE)
        except (KinemimicError, OSError):
            clear(task.folder)
            raise
        made = made_from(task)
    row = processed.row | {"file": str(task.capture), "folder": str(task.folder)}
    return Kept(row, {} if row["status"] == "failed" else made)
