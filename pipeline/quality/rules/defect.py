"""Defects of a capture: the catalogue of rules, and the record of each defect found and its treatment."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any, Literal

Action = Literal["repaired", "flagged", "refused"]

# Every rule by name, with its title, in the order in which reports list them.
RULES: dict[str, str] = {
    "several_people": "several people",
    "renumbered_people": "people numbered anew",
    "wrong_names": "wrong joint names",
    "wrong_labels": "wrong marker labels",
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
    "hidden_legs": "hidden legs",
    "wide_hips": "wide hips",
    "impossible_limbs": "impossible limbs",
    "bone_drift": "bone-length drift",
    "swapped_sides": "left and right swapped",
    "knee_sign": "knee bends forward",
    "jumps": "single-frame jumps",
    "gaps": "gaps",
}


@dataclass(frozen=True)
class Defect:
    """One defect of one capture.

    rule: a key of RULES; count: number of occurrences, in `unit` ("frames", "joint positions", "joints", …);
    action: "repaired" (the clip no longer has it), "flagged" (left in the clip, for the user to judge) or
    "refused" (the capture cannot be used); text: description of the finding and its treatment; frames:
    inclusive (first, last) runs of frames of the returned clip. Dropped frames have no number there; a
    dropped repeat is reported at the frame that it repeats.
    """

    rule: str
    count: int
    unit: str
    action: Action
    text: str
    frames: tuple[tuple[int, int], ...] = ()

    def __post_init__(self) -> None:
        if self.rule not in RULES:
            raise ValueError(f"expected a rule among {', '.join(RULES)}, found {self.rule!r}")

    def to_json(self) -> dict[str, Any]:
        """The record as JSON values."""
        return {**asdict(self), "frames": [list(run) for run in self.frames]}


def defect_from_json(record: dict[str, Any]) -> Defect:
    """The inverse of `Defect.to_json`."""
    return Defect(**{**record, "frames": tuple((first, last) for first, last in record["frames"])})


def sorted_defects(defects: Iterable[Defect]) -> tuple[Defect, ...]:
    """The defects in the order of RULES."""
    rank = {rule: index for index, rule in enumerate(RULES)}
    return tuple(sorted(defects, key=lambda defect: rank[defect.rule]))
