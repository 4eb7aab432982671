"""What is known of the training of a policy: how long it was, and whether it has finished."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Training:
    """What is known of a policy's training; budget: None if unknown."""

    samples: int = 0
    budget: int | None = None
    finished: bool = True
    preset: str = "default"
    seed: int = 0

    @property
    def unfinished(self) -> str:
        """`training unfinished: 400,000 of 1,000,000 samples`; "" for a finished training."""
        if self.finished:
            return ""
        of = "" if self.budget is None else f" of {self.budget:,}"
        return f"training unfinished: {self.samples:,}{of} samples"

    @classmethod
    def of(cls, summary: Mapping[str, Any]) -> Training:
        """From `train` of scores.json, pushes.json or a scenario's results, of any version."""
        return cls(
            samples=summary.get("samples") or 0,
            budget=summary.get("budget"),
            finished=summary.get("finished") is not False,
            preset=summary.get("preset") or "",
            seed=summary.get("seed") or 0,
        )
