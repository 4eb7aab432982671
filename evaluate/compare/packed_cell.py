"""Cells of a comparison on an executor that shares no disk: their folders go there and come back as bytes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from kinemimic.evaluate.compare.cell import Cell, prepare, train_and_score
from kinemimic.evaluate.compare.job_runner import Listener
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import atomic
from kinemimic.pipeline.parallel.executor import Executor
from kinemimic.pipeline.parallel.task_pool import Failure

# A file that marks a budget as finished is written after those that it stands for.
_MARK = "scores-"


@dataclass(frozen=True)
class PackedCell:
    """A cell with the files of its folder, name -> bytes: the motion, a checkpoint, finished budgets."""

    cell: Cell
    files: Mapping[str, bytes]


@dataclass(frozen=True)
class TrainedCell:
    """The files of a cell's folder after its training; refused: the error that ended it, in one line."""

    files: Mapping[str, bytes]
    refused: str | None


def pack(cell: Cell) -> PackedCell:
    """A cell with its motion copied into its folder; KinemimicError if the folder has another motion."""
    prepare(cell)
    return PackedCell(cell, _files(cell.folder))


def train_packed(packed: PackedCell) -> TrainedCell:
    """Train and score a cell in a temporary folder of this machine."""
    with TemporaryDirectory(prefix="kinemimic-") as place:
        cell = replace(packed.cell, out=Path(place))
        _write(cell.folder, packed.files)
        try:
            train_and_score(cell)
        except KinemimicError as error:
            return TrainedCell(_files(cell.folder), str(error))
        return TrainedCell(_files(cell.folder), None)


def spread(executor: Executor, cells: Sequence[Cell], listener: Listener[Cell]) -> None:
    """Train and score cells on an executor; a cell that fails does not affect the others."""

    def packed() -> Iterator[PackedCell]:
        for cell in cells:
            listener.begun(cell)
            yield pack(cell)

    for index, outcome in executor.map(train_packed, packed()):
        cell = cells[index]
        if isinstance(outcome, Failure):
            listener.ended(cell, outcome.reason)
            continue
        _write(cell.folder, outcome.files)
        listener.ended(cell, outcome.refused)


def _files(folder: Path) -> dict[str, bytes]:
    found = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in found}


def _write(folder: Path, files: Mapping[str, bytes]) -> None:
    for name in sorted(files, key=lambda name: name.startswith(_MARK)):
        with atomic(folder / name) as temporary:
            temporary.write_bytes(files[name])
