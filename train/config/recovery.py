"""Settings of the recoveries that a trained policy learns (`train/recovery`)."""

from __future__ import annotations

from dataclasses import dataclass

from kinemimic.pipeline.files.validation.records import RecordError
from kinemimic.train.config.baseline_config import require_counts


@dataclass(frozen=True)
class Recovery:
    """Where recoveries are searched, and how they are learned.

    phases: of the motion's cycle at which pushes begin, of half a cycle where the policy mirrors; directions:
    of the pushes, degrees counterclockwise from the reference's heading; forces: N, which one maneuver shall
    survive; candidates, elite, iterations: of the cross-entropy method; taught: least share of pushes that a
    maneuver survives, to be taught; rounds: of lessons and regression; humanoids: of a round.
    """

    phases: int = 24
    directions: tuple[float, ...] = (180.0, 90.0, -90.0)
    forces: tuple[float, ...] = (220.0, 260.0, 300.0, 340.0)
    candidates: int = 30
    elite: int = 6
    iterations: int = 16
    taught: float = 0.4
    rounds: int = 4
    humanoids: int = 480

    def __post_init__(self) -> None:
        require_counts(self, "phases", "candidates", "elite", "iterations", "rounds", "humanoids")
        if not self.forces or min(self.forces) <= 0.0:
            raise RecordError("forces", expected="forces above 0 N", found=f"{list(self.forces)}")
        if self.elite > self.candidates:
            raise RecordError(
                "elite", expected=f"at most {self.candidates} candidates", found=f"{self.elite}"
            )
