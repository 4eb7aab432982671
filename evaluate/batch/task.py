"""A capture of a batch: what is to be done with it, and whether that has been done.

Imported by every call, also by one that has nothing to do: it loads no stage.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kinemimic.evaluate.batch.state import Kept
from kinemimic.pipeline.files.provenance import versions
from kinemimic.pipeline.files.store import file_hash
from kinemimic.pipeline.run_folder.capture import sources_of

# How far a capture goes -> the last stages, each after those before it.
TARGETS: Mapping[str, tuple[str, ...]] = {
    "clip": ("ingest", "convert"),
    "motion": ("retarget",),
    "performed": ("evaluate",),
}
TRACKER = "tracker"  # the policy that performs
MADE_SCHEMA = 1
_OUTPUTS = ("clip.parquet", "quaternions.parquet", "motion.json", "gait.json", "scores.json")

Row = dict[str, Any]
# Size, time of change (ns) and SHA-256 of a file; None if there is none.
Mark = tuple[int, int, str] | None


@dataclass(frozen=True)
class CaptureTask:
    """A capture, its run folder, the options of the stages as `run` takes them, and a key of TARGETS.

    name: the run folder's path below the folder of the batch; resume: the run folder has results for the same
    capture, options and version, which are kept.
    """

    capture: Path
    folder: Path
    options: Mapping[str, Mapping[str, Any]]
    to: str = "motion"
    name: str = ""
    resume: bool = False

    @property
    def stages(self) -> tuple[str, ...]:
        """The stages in their order."""
        names = [*TARGETS]
        return tuple(stage for name in names[: names.index(self.to) + 1] for stage in TARGETS[name])


def made_from(task: CaptureTask) -> dict[str, Any]:
    """What the row of a finished task was made from, and what it says files contain; JSON values."""
    return {
        **_wanted(task),
        "to": task.to,
        "inputs": {name: _mark(path) for name, path in sources_of(task.folder, task.capture).items()},
        "outputs": {name: _mark(task.folder / name) for name in _OUTPUTS},
    }


def up_to_date(task: CaptureTask, kept: Kept) -> dict[str, Any] | None:
    """`made_from` of an earlier row, if it holds for this task, or for one that goes less far; else None.

    A file of the same size and time counts as the same; of another time, if its content is the same: its new
    time is then in what is returned.
    """
    made = kept.made_from
    try:
        targets = [*TARGETS]
        if {key: made[key] for key in _wanted(task)} != _wanted(task):
            return None
        if targets.index(made["to"]) < targets.index(task.to):
            return None
        place = task.capture if task.capture.is_dir() else task.capture.parent
        inputs = {name: _same(place / name, mark) for name, mark in made["inputs"].items()}
        outputs = {name: _same(task.folder / name, mark) for name, mark in made["outputs"].items()}
    except (KeyError, TypeError, ValueError, OSError):
        return None
    if task.capture.is_dir() and len(sources_of(task.folder, task.capture)) != len(inputs):
        return None
    found = [*inputs.values(), *outputs.values()]
    return None if "changed" in found else made | {"inputs": inputs, "outputs": outputs}


def resumable(task: CaptureTask, kept: Kept) -> bool:
    """Whether only further stages are missing."""
    less = str(kept.made_from.get("to"))
    if kept.row.get("status") != "accepted" or less not in TARGETS:
        return False
    return up_to_date(CaptureTask(task.capture, task.folder, task.options, less), kept) is not None


def _wanted(task: CaptureTask) -> dict[str, Any]:
    config = {stage: dict(options) for stage, options in task.options.items()}
    return {"schema": MADE_SCHEMA, "config": config, "version": versions().get("kinemimic")}


def _mark(path: Path) -> Mark:
    if not path.is_file():
        return None
    found = path.stat()
    return found.st_size, found.st_mtime_ns, file_hash(path)


def _same(path: Path, mark: Any) -> Any:
    """The mark with the present time, or "changed"."""
    if not path.is_file():
        return None if mark is None else "changed"
    if mark is None:
        return "changed"
    size, changed, sha256 = mark
    found = path.stat()
    if found.st_size != size:
        return "changed"
    if found.st_mtime_ns == changed:
        return mark
    return [size, found.st_mtime_ns, sha256] if file_hash(path) == sha256 else "changed"
