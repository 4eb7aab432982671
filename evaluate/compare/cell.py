"""A cell of a comparison: one task, one variant, one seed, in a run folder of its own.

The folder holds the motion with what belongs to it, copied, and the training. What a budget came to is kept
there as policy-BUDGET.safetensors, policy-BUDGET.json and, last, scores-BUDGET.json.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kinemimic.evaluate.compare.task import MOTION
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import copy_file, read_json
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.rollout.policy import read_record

# What else `train` and `evaluate` read, where it is there.
BESIDE = ("capture.parquet", "gait.json", "quality.json", "gimbal.json")


@dataclass(frozen=True)
class Cell:
    """source: run folder of the motion; identity: the motion's; task: its name; config: with the seed;
    budgets: increasing; engine: of `train/engines.py`, resolved; anyway: also on what the gate refuses."""

    source: Path
    identity: str
    task: str
    variant: str
    config: TrainConfig
    budgets: tuple[int, ...]
    out: Path
    engine: str
    anyway: bool = False

    @property
    def folder(self) -> Path:
        return self.out / self.task / self.variant / f"seed{self.config.seed}"

    @property
    def name(self) -> str:
        """For people."""
        return f"{self.task} {self.variant} seed {self.config.seed}"


def outcome(cell: Cell, budget: int) -> tuple[dict[str, Any], dict[str, Any]] | None:
    """policy.json and scores.json of a finished budget, None where it is not finished.

    KinemimicError if what lies there is of another motion, engine or of other settings.
    """
    path = cell.folder / f"scores-{budget}.json"
    if not path.exists():
        return None
    record, scores = read_record(cell.folder / f"policy-{budget}.json"), read_json(path)
    _expect(cell, "motion", record["provenance"]["inputs"]["motion"] == cell.identity)
    wanted, found = ({**config, "budget": None} for config in (cell.config.to_json(), record["config"]))
    _expect(cell, "settings", json.loads(json.dumps(wanted)) == found)
    _expect(cell, "engine", record["engine"] == cell.engine)
    return record, scores


def conduct(cell: Cell) -> None:
    """Train and evaluate one budget after the other, but for what is finished; goes on from the checkpoint.

    Raises what `train` and `evaluate` raise.
    """
    # The process that hands out cells loads no simulation and no torch.
    from kinemimic.evaluate.scoring.command import evaluate  # noqa: PLC0415
    from kinemimic.train.command import train  # noqa: PLC0415

    _prepare(cell)
    unfinished = [budget for budget in cell.budgets if outcome(cell, budget) is None]
    for budget in unfinished:
        later = [path.name for path in cell.folder.glob("scores-*.json") if _budget(path) > budget]
        if later:
            raise KinemimicError(
                f"{cell.folder}: expected budgets in increasing order, found {later[0]} before that of "
                f"{budget}; a training cannot go back: name another --out"
            )
        train(
            cell.folder,
            config=cell.config,
            budget=budget,
            workers=1,
            engine=cell.engine,
            anyway=cell.anyway,
        )
        evaluate(cell.folder, workers=1, engine=cell.engine)
        # The scores last: they say that the budget is finished.
        for name in ("policy.safetensors", "policy.json", "scores.json"):
            kept = cell.folder / f"{Path(name).stem}-{budget}{Path(name).suffix}"
            copy_file(cell.folder / name, kept)


def _prepare(cell: Cell) -> None:
    """Copy the motion and what belongs to it, the motion last: it says that all is there."""
    if (cell.folder / MOTION).exists():
        _expect(cell, "motion", read_motion_json(cell.folder / MOTION).identity == cell.identity)
        return
    for name in BESIDE:
        if (cell.source / name).exists():
            copy_file(cell.source / name, cell.folder / name)
    copy_file(cell.source / MOTION, cell.folder / MOTION)


def _budget(path: Path) -> int:
    digits = path.stem.partition("-")[2]
    return int(digits) if digits.isdecimal() else 0


def _expect(cell: Cell, what: str, same: bool) -> None:
    if not same:
        raise KinemimicError(
            f"{cell.folder}: expected results of the same {what}, found others'; name another --out, or "
            "delete it"
        )
