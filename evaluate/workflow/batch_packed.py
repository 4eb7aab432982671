"""A capture of a batch for an executor that shares no disk: files go there and come back as bytes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from kinemimic.evaluate.workflow.batch_capture import clear, process
from kinemimic.evaluate.workflow.batch_state import Kept
from kinemimic.evaluate.workflow.batch_task import Row, Task, made_from
from kinemimic.pipeline.files.store import atomic
from kinemimic.pipeline.readers.search import files_to_read
from kinemimic.pipeline.run_folder.lock import locked
from kinemimic.pipeline.run_folder.record import RUN_FILE


@dataclass(frozen=True)
class Packed:
    """A task without its run folder.

    capture: name of the file, or of the folder; in_folder: whether it is one; files: of the capture and
    beside it, name -> bytes; options, to: as in `Task`.
    """

    name: str
    capture: str
    in_folder: bool
    files: Mapping[str, bytes]
    options: Mapping[str, Mapping[str, Any]]
    to: str


@dataclass(frozen=True)
class Processed:
    """The row of a packed task, whose paths are those of its own machine, and the files of its run folder."""

    row: Row
    files: Mapping[str, bytes]


def pack(task: Task) -> Packed:
    """The task with the bytes of its files; OSError for a file that cannot be read."""
    files = {name: path.read_bytes() for name, path in files_to_read(task.capture).items()}
    return Packed(task.name, task.capture.name, task.capture.is_dir(), files, task.options, task.to)


def process_packed(packed: Packed) -> Processed:
    """Carry out a task in a temporary folder of this machine."""
    with TemporaryDirectory(prefix="kinemimic-") as place:
        capture, folder = Path(place) / "in" / packed.capture, Path(place) / "out"
        for name, content in packed.files.items():
            path = capture / name if packed.in_folder else capture.with_name(name)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        row = process(Task(capture, folder, packed.options, packed.to, packed.name)).row
        files = {
            path.relative_to(folder).as_posix(): path.read_bytes()
            for path in sorted(folder.rglob("*"))
            if path.is_file()
        }
    return Processed(row, files)


def unpack(task: Task, processed: Processed) -> Kept:
    """Write the run folder of a task that was carried out elsewhere; its record comes last."""
    with locked(task.folder):
        clear(task.folder)
        for name, content in sorted(processed.files.items(), key=lambda item: item[0] == RUN_FILE):
            with atomic(task.folder / name) as temporary:
                temporary.write_bytes(content)
        made = made_from(task)
    row = processed.row | {"file": str(task.capture), "folder": str(task.folder)}
    return Kept(row, {} if row["status"] == "failed" else made)
