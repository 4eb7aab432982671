"""What can be wrong with a capture: one record for each defect that was found, and what was done about it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any, Literal

Action = Literal["repaired", "flagged", "refused"]

# Every rule by name, with its short title, in the sequence in which reports list them.
RULES: dict[str, str] = {
    "several_people": "several people",
    "wrong_names": "wrong joint names",
    "zero_frames": "all-zero frames",
    "calibration_frames": "calibration pose first",
    "duplicate_frames": "duplicated frames",
    "dropped_frames": "dropped frames",
    "irregular_clock": "irregular clock",
    "wrong_rate": "wrong declared rate",
    "wrong_units": "wrong units",
    "wrong_up_axis": "wrong up-axis",
    "mirrored": "mirrored",
    "turning_camera": "camera turns with the walker",
    "impossible_limbs": "impossible limbs",
    "bone_drift": "bone-length drift",
    "swapped_sides": "left and right swapped",
    "jumps": "single-frame jumps",
    "gaps": "gaps",
}


@dataclass(frozen=True)
class Defect:
    """One defect of one capture.

    rule: a key of RULES; count: how often, in units of `of` ("frames", "joint positions", "joints", …);
    action: "repaired" (the clip no longer has it), "flagged" (it has, and a person should know) or "refused"
    (nothing good can come of this capture); text: what was found, where, and what was done or is to be done;
    frames: inclusive (first, last) runs of frames of the clip as it was handed on, where frames can be named
    (those that were dropped cannot; of repeats it is the one that stayed).
    """

    rule: str
    count: int
    of: str
    action: Action
    text: str
    frames: tuple[tuple[int, int], ...] = ()

    def __post_init__(self) -> None:
        if self.rule not in RULES:
            raise ValueError(f"no rule {self.rule!r}; there are {', '.join(RULES)}")

    def to_json(self) -> dict[str, Any]:
        """The record as JSON values."""
        return {**asdict(self), "frames": [list(run) for run in self.frames]}


def defect_from_json(record: dict[str, Any]) -> Defect:
    """The inverse of `Defect.to_json`."""
    return Defect(**{**record, "frames": tuple((first, last) for first, last in record["frames"])})


def sorted_defects(defects: Iterable[Defect]) -> tuple[Defect, ...]:
    """Defects in the sequence of RULES."""
    rank = {rule: index for index, rule in enumerate(RULES)}
    return tuple(sorted(defects, key=lambda defect: rank[defect.rule]))


def plural(count: int, noun: str) -> str:
    """The count with its noun, which takes a plain s: "1 frame", "2 frames"."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
