"""A cell of a comparison: one task, one variant and one seed, in its own run folder.

The folder holds copies of the motion and its related files, and the training. The results of each budget are
kept as policy-BUDGET.safetensors, policy-BUDGET.json and, written last, scores-BUDGET.json.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import copy_file, read_json
from kinemimic.retarget.formats.motion_json import MOTION, read_motion_json
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.rollout.policy import read_record

# Optional files that `train` and `evaluate` read.
RELATED = ("capture.parquet", "gait.json", "quality.json", "gimbal.json")


@dataclass(frozen=True)
class Cell:
    """source: run folder of the motion; identity: of the motion; task: its name; config: includes the seed;
    budgets: increasing; engine: a resolved name from `train/sim/engines.py`; anyway: also train on motions
    that the gate refuses; workers, device: of `train`."""

    source: Path
    identity: str
    task: str
    variant: str
    config: TrainConfig
    budgets: tuple[int, ...]
    out: Path
    engine: str
    anyway: bool = False
    workers: int = 1
    device: str = "cpu"

    @property
    def folder(self) -> Path:
        return self.out / self.task / self.variant / f"seed{self.config.seed}"

    @property
    def name(self) -> str:
        """Human-readable name."""
        return f"{self.task} {self.variant} seed {self.config.seed}"


def finished_results(cell: Cell, budget: int) -> tuple[dict[str, Any], dict[str, Any]] | None:
    """policy.json and scores.json of a finished budget, or None if it is not finished.

    KinemimicError if the results belong to another motion, engine, device or configuration.
    """
    path = cell.folder / f"scores-{budget}.json"
    if not path.exists():
        return None
    record, scores = read_record(cell.folder / f"policy-{budget}.json"), read_json(path)
    _expect(cell, "motion", record["provenance"]["inputs"]["motion"] == cell.identity)
    wanted, found = ({**config, "budget": None} for config in (cell.config.to_json(), record["config"]))
    _expect(cell, "settings", json.loads(json.dumps(wanted)) == found)
    _expect(cell, "engine", record["engine"] == cell.engine)
    _expect(cell, "device", ("device" in record) == (cell.device != "cpu"))
    return record, scores


def train_and_score(cell: Cell) -> None:
    """Train and evaluate the unfinished budgets in order, resuming from the checkpoint.

    Raises what `train` and `evaluate` raise.
    """
    # Imported here so that the process that schedules the cells loads neither the simulation nor torch.
    from kinemimic.evaluate.scoring.evaluate import evaluate  # noqa: PLC0415
    from kinemimic.train.command import train  # noqa: PLC0415

    prepare(cell)
    unfinished = [budget for budget in cell.budgets if finished_results(cell, budget) is None]
    for budget in unfinished:
        later = [path.name for path in cell.folder.glob("scores-*.json") if _budget(path) > budget]
        if later:
            raise KinemimicError(
                f"{cell.folder}: expected budgets in increasing order, found {later[0]} but no scores at "
                f"{budget}; training cannot go back: choose another --out"
            )
        train(
            cell.folder,
            config=cell.config,
            budget=budget,
            workers=cell.workers,
            engine=cell.engine,
            anyway=cell.anyway,
            device=cell.device,
        )
        evaluate(cell.folder, workers=cell.workers, engine=cell.engine)
        # The scores are written last: they mark the budget as finished.
        for name in ("policy.safetensors", "policy.json", "scores.json"):
            kept = cell.folder / f"{Path(name).stem}-{budget}{Path(name).suffix}"
            copy_file(cell.folder / name, kept)


def prepare(cell: Cell) -> None:
    """Copy the motion and its related files; the motion last, to mark the copy as complete.

    KinemimicError if the folder has another motion.
    """
    if (cell.folder / MOTION).exists():
        _expect(cell, "motion", read_motion_json(cell.folder / MOTION).identity == cell.identity)
        return
    for name in RELATED:
        if (cell.source / name).exists():
            copy_file(cell.source / name, cell.folder / name)
    copy_file(cell.source / MOTION, cell.folder / MOTION)


def _budget(path: Path) -> int:
    digits = path.stem.partition("-")[2]
    return int(digits) if digits.isdecimal() else 0


def _expect(cell: Cell, what: str, same: bool) -> None:
    if not same:
        raise KinemimicError(
            f"{cell.folder}: expected results of the same {what}, found another; choose another --out, or "
            "delete it"
        )
