"""A comparison on a cluster is the comparison of one machine, also when a node is lost in its middle."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from peers.ray_nodes import RayNodes
from peers.small_training import SMALL

from kinemimic.evaluate.compare import command as module
from kinemimic.evaluate.compare.cell import Cell
from kinemimic.evaluate.compare.command import compare
from kinemimic.evaluate.compare.packed_cell import TrainedCell, train_cells_on
from kinemimic.evaluate.compare.task import ComparisonTask
from kinemimic.pipeline.files.store import write_text
from kinemimic.retarget.formats.motion_json import motion_to_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.presets import PRESETS

BUDGETS = (SMALL.batch, 3 * SMALL.batch)


class Hearing:
    """What became of each cell."""

    def __init__(self) -> None:
        self.ended_with: dict[int, str | None] = {}

    def begun(self, task: Cell) -> None: ...

    def advanced(self, task: Cell, state: object) -> None: ...

    def ended(self, task: Cell, error: str | None) -> None:
        self.ended_with[task.config.seed] = error


class Returning:
    """Executor of a cluster that returns these files for one cell after the other."""

    shares_disk = False

    def __init__(self, *files: dict[str, bytes]) -> None:
        self._files = files

    def map(self, work: Any, tasks: Any) -> Iterator[tuple[int, Any]]:
        for (index, _), files in zip(enumerate(tasks), self._files, strict=True):
            yield index, TrainedCell(files, None)


def test_a_cell_with_strange_files_fails_alone(walk: Motion, tmp_path: Path) -> None:
    run, other = tmp_path / "walk", tmp_path / "other"
    for folder, motion in ((run, walk), (other, replace(walk, rate=2 * walk.rate))):
        write_text(folder / "motion.json", motion_to_json(motion))
    cells = [
        Cell(
            run, walk.identity, "walk", "default", replace(SMALL, seed=seed), (1,), tmp_path / "out", "native"
        )
        for seed in range(3)
    ]
    write_text(cells[1].folder / "motion.json", (other / "motion.json").read_text())
    heard = Hearing()
    train_cells_on(Returning({"../../../../stolen": b"x"}, {"scores-1.json": b"{}"}), cells, heard)
    found = heard.ended_with
    assert "expected names of files below it from another machine, found '../" in str(found[0])
    assert "expected results of the same motion, found another" in str(found[1])
    assert found[2] is None
    assert not (tmp_path.parent / "stolen").exists()
    assert not list(tmp_path.rglob("stolen"))
    assert (cells[2].folder / "scores-1.json").exists()


def compared(run: Path, out: Path, ray: str | None) -> dict[str, Any]:
    return compare(
        [ComparisonTask(run)], {"default": SMALL}, seeds=4, budgets=BUDGETS, out=out, jobs=2, ray=ray
    )


@pytest.mark.slow
def test_a_comparison_on_a_cluster_is_that_of_one_machine(
    walk: Motion, tmp_path: Path, ray_nodes: RayNodes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(PRESETS, "default", SMALL)
    run = tmp_path / "walk"
    write_text(run / "motion.json", motion_to_json(replace(walk, cyclic=False)))
    timer = threading.Timer(6.0, ray_nodes.kill, ["second"])
    timer.start()
    there = compared(run, tmp_path / "there", ray_nodes.cluster.address)
    timer.join()
    here = compared(run, tmp_path / "here", None)
    assert there["failed"] == here["failed"] == {}
    assert [row["seed"] for row in there["cells"]] == [0, 0, 1, 1, 2, 2, 3, 3]
    policies = sorted(
        path.relative_to(tmp_path / "here") for path in (tmp_path / "here").rglob("policy-*.saf*")
    )
    assert len(policies) == 8
    for path in policies:
        assert (tmp_path / "there" / path).read_bytes() == (tmp_path / "here" / path).read_bytes()
    # Called again, nothing is trained: no executor is asked.
    monkeypatch.setattr(
        module, "train_cells_on", lambda executor, cells, listener: pytest.fail(str(cells)) if cells else None
    )
    monkeypatch.setattr(module, "RayExecutor", lambda **_: None)
    assert compared(run, tmp_path / "there", ray_nodes.cluster.address)["cells"] == there["cells"]
    assert json.loads((tmp_path / "there" / "compare.json").read_text())["failed"] == {}
