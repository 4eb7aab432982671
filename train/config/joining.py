"""Settings of joining (`train/recovery/joining.py`)."""

from __future__ import annotations

from dataclasses import dataclass

from kinemimic.train.config.baseline_config import require_counts


@dataclass(frozen=True)
class Joining:
    """rounds: of lessons and regression; humanoids: of a round."""

    rounds: int = 6
    humanoids: int = 240

    def __post_init__(self) -> None:
        require_counts(self, "rounds", "humanoids")
