"""Cells of a comparison on an executor that shares no disk: their folders go there and come back as bytes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from kinemimic.evaluate.compare.cell import Cell, prepare, train_and_score
from kinemimic.evaluate.compare.job_runner import Listener
from kinemimic.pipeline.errors import KinemimicError, one_line
from kinemimic.pipeline.parallel.executor import Executor
from kinemimic.pipeline.parallel.packed_files import PackedFiles, read_folder, write_files
from kinemimic.pipeline.parallel.task_pool import Failure

# A file that marks a budget as finished is written after those that it stands for.
_MARK = "scores-"


@dataclass(frozen=True)
class PackedCell:
    """A cell with the files of its folder: the motion, a checkpoint, finished budgets."""

    cell: Cell
    files: PackedFiles


@dataclass(frozen=True)
class TrainedCell:
    """The files of a cell's folder after its training; refused: the error that ended it, in one line."""

    files: PackedFiles
    refused: str | None


def pack(cell: Cell) -> PackedCell:
    """A cell with its motion copied into its folder; KinemimicError if the folder has another motion."""
    prepare(cell)
    return PackedCell(cell, read_folder(cell.folder))


def train_packed(packed: PackedCell) -> TrainedCell:
    """Train and score a cell in a temporary folder of this machine."""
    with TemporaryDirectory(prefix="kinemimic-") as place:
        cell = replace(packed.cell, out=Path(place))
        _write(cell, packed.files)
        try:
            train_and_score(cell)
        except (KinemimicError, OSError) as error:
            return TrainedCell(read_folder(cell.folder), one_line(error))
        return TrainedCell(read_folder(cell.folder), None)


def train_cells_on(executor: Executor, cells: Sequence[Cell], listener: Listener[Cell]) -> None:
    """Train and score cells on an executor; a cell that fails does not affect the others."""

    sent: list[Cell] = []

    def packed() -> Iterator[PackedCell]:
        for cell in cells:
            listener.begun(cell)
            try:
                one = pack(cell)
            except (KinemimicError, OSError) as error:
                listener.ended(cell, one_line(error))
                continue
            sent.append(cell)
            yield one

    for index, outcome in executor.map(train_packed, packed()):
        cell = sent[index]
        if isinstance(outcome, Failure):
            listener.ended(cell, outcome.reason)
            continue
        try:
            _write(cell, outcome.files)
        except (KinemimicError, OSError) as error:
            listener.ended(cell, one_line(error))
        else:
            listener.ended(cell, outcome.refused)


def _write(cell: Cell, files: PackedFiles) -> None:
    write_files(cell.folder, files, last=lambda name: name.startswith(_MARK))
