"""State of a running comparison: finished and failed cells, results on disk, progress bars, folder lock."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from kinemimic.evaluate.compare.cell import Cell, finished_results
from kinemimic.evaluate.compare.comparison import RESULTS
from kinemimic.evaluate.compare.table import curves, metrics, summary, table_csv
from kinemimic.pipeline.cli.progress import Bar, Bars
from kinemimic.pipeline.cli.progress_state import ProgressState
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import write_json, write_text
from kinemimic.pipeline.run_folder.lock import locked


@contextmanager
def exclusive(out: Path) -> Iterator[None]:
    """Lock the folder: two comparisons in it would train the same cells."""
    with ExitStack() as held:
        try:
            held.enter_context(locked(out))
        except KinemimicError:
            raise KinemimicError(
                f"{out}: expected no other comparison in this folder, found one running; wait, or name "
                "another --out"
            ) from None
        yield


class Ledger:
    """The cells of a comparison and their results so far.

    header: what compare.json says beside the results; failed: cell name -> one-line error.
    """

    def __init__(self, out: Path, cells: Sequence[Cell], header: Mapping[str, Any]) -> None:
        self._out, self._header = out, header
        self.cells, self.failed = cells, dict[str, str]()

    def finished(self, cell: Cell) -> dict[int, tuple[dict[str, Any], dict[str, Any]]]:
        """policy.json and scores.json of each finished budget; results of another comparison are an error."""
        try:
            found = {budget: finished_results(cell, budget) for budget in cell.budgets}
        except KinemimicError as error:
            self.failed[cell.name] = str(error)
            return {}
        return {budget: both for budget, both in found.items() if both is not None}

    def unfinished(self) -> list[Cell]:
        """Cells with unfinished budgets."""
        left = [cell for cell in self.cells if len(self.finished(cell)) < len(cell.budgets)]
        return [cell for cell in left if cell.name not in self.failed]

    def write(self) -> dict[str, Any]:
        """Write compare.json and compare.csv of all finished budgets; returns the content of compare.json."""
        rows = [
            {
                "task": cell.task,
                "variant": cell.variant,
                "seed": cell.config.seed,
                "budget": budget,
                "engine": record["engine"],
                **metrics(record, scores),
            }
            for cell in self.cells
            for budget, (record, scores) in self.finished(cell).items()
        ]
        furthest: dict[tuple[str, str], list[dict[str, Any]]] = {}
        for cell in self.cells:
            if found := self.finished(cell):
                furthest.setdefault((cell.task, cell.variant), []).append(found[max(found)][0])
        content = {
            **self._header,
            "summary": summary(rows),
            "curves": curves(furthest),
            "cells": rows,
            "failed": self.failed,
        }
        write_text(self._out / "compare.csv", table_csv(rows))
        write_json(self._out / RESULTS, content)
        return content


class ProgressBars:
    """A progress bar for all cells and one per running cell; writes the results after each cell."""

    def __init__(self, several: Bars, ledger: Ledger) -> None:
        self._several, self._ledger = several, ledger
        self._running: dict[str, tuple[Bar, float]] = {}
        self._training: set[str] = set()
        self._all = several.add(
            "compare",
            sum(cell.budgets[-1] for cell in ledger.cells),
            done=sum(max(ledger.finished(cell), default=0) for cell in ledger.cells),
            unit="samples",
        )
        for name, error in ledger.failed.items():
            several.say(f"{name}: {error}")

    def begun(self, cell: Cell) -> None:
        done = max(self._ledger.finished(cell), default=0)
        bar = self._several.add(cell.name, cell.budgets[-1], done=done, unit="samples")
        self._running[cell.name] = (bar, done)
        self._all.advance(0, running=len(self._running))

    def advanced(self, cell: Cell, state: ProgressState) -> None:
        bar, before = self._running[cell.name]
        if state.what != "train":
            bar.advance(0, now=state.what)
            return
        forward = max(0.0, state.done - before)
        self._running[cell.name] = (bar, before + forward)
        if cell.name not in self._training:
            # A resumed training begins where it was interrupted.
            self._training.add(cell.name)
            self._all.resumed(forward)
            bar.resumed(forward)
            forward = 0.0
        self._all.advance(forward)
        bar.advance(forward, **state.notes)

    def ended(self, cell: Cell, error: str | None) -> None:
        self._several.remove(self._running.pop(cell.name)[0])
        self._all.advance(0, running=len(self._running))
        if error is not None:
            self._ledger.failed[cell.name] = " ".join(error.split())
            self._several.say(f"{cell.name}: {self._ledger.failed[cell.name]}")
        self._ledger.write()
