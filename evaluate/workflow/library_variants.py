"""The random variants of a motion library: how many of each sort, and their making in parallel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.parallel.task_pool import parallel_map
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.library.excerpts import excerpt, turning
from kinemimic.retarget.library.exercises import exercise
from kinemimic.retarget.library.motion_library import Entry
from kinemimic.retarget.library.variants import SUBJECT, plausible_variant

# Of the variants, by sort; walks are the rest. A sort without a recording to vary goes to the others.
SHARES = {"run": 0.2, "turning": 0.05, "excerpt": 0.06, "exercise": 0.12}
# `kind` of a variant's entry.
KINDS = {"walk": "walk", "run": "run", "turning": "walk", "excerpt": "motion", "exercise": "motion"}
CHUNK = 20  # variants of a task


@dataclass(frozen=True)
class Sources:
    """The motions of the training part that are varied: loops of walks and of runs, and motions once."""

    walks: Sequence[Motion]
    runs: Sequence[Motion]
    once: Sequence[Motion]

    @classmethod
    def of(cls, motions: Sequence[Motion], entries: Sequence[Entry]) -> Sources:
        """From the motions of the split "train"."""
        pairs = [
            (motion, entry) for motion, entry in zip(motions, entries, strict=True) if entry.split == "train"
        ]
        return cls(
            *(
                [motion for motion, entry in pairs if entry.cyclic and entry.kind == kind]
                for kind in ("walk", "run")
            ),
            [motion for motion, entry in pairs if not entry.cyclic],
        )

    def counts(self, count: int) -> dict[str, int]:
        """How many of `count` variants there are of each sort; KinemimicError without a loop."""
        if not (self.walks or self.runs):
            raise KinemimicError("--variants: expected walks or runs to vary, found no loops")
        present = {"run": self.runs, "turning": self.walks, "excerpt": self.once, "exercise": True}
        counts = {sort: round(share * count) for sort, share in SHARES.items() if present[sort]}
        rest = count - sum(counts.values())
        if self.walks:
            counts["walk"] = rest
        else:
            counts["run"] += rest
        return counts


def made_variants(
    motions: Sequence[Motion], entries: Sequence[Entry], count: int, seed: int, jobs: int
) -> list[tuple[Motion, Entry]]:
    """`count` variants of the motions of the training part, the same for the same motions, count and seed."""
    if not count:
        return []
    sources = Sources.of(motions, entries)
    tasks = [
        (sources, sort, seed, range(first, min(first + CHUNK, number)))
        for sort, number in sources.counts(count).items()
        for first in range(0, number, CHUNK)
    ]
    with progress("variants", len(tasks), unit=f"chunks of {CHUNK}") as bar:
        try:
            found = parallel_map(_make, tasks, workers=jobs, progress=bar.advance)
        except ValueError as error:
            raise KinemimicError(f"--variants: expected walks or runs to vary, found {error}") from None
    made: list[tuple[Motion, Entry]] = []
    for (_, sort, _, numbers), varied in zip(tasks, found, strict=True):
        for number, motion in zip(numbers, varied, strict=True):
            x, y, z = (float(value) for value in motion.cycle_offset)
            name, frames, rate = f"{SUBJECT}/{sort}-{number:05d}", len(motion.root), float(motion.rate)
            entry = Entry(name, SUBJECT, KINDS[sort], "train", rate, frames, motion.cyclic, (x, y, z))
            made.append((motion, entry))
    return made


def _make(task: tuple[Sources, str, int, range]) -> list[Motion]:
    sources, sort, seed, numbers = task
    return [_variant(sources, sort, seed, number) for number in numbers]


def _variant(sources: Sources, sort: str, seed: int, number: int) -> Motion:
    if sort == "exercise":
        return exercise(seed, number)
    if sort == "excerpt":
        return excerpt(sources.once, seed, number)
    if sort == "turning":
        # Loops of their own, apart from those of the walks.
        loop = plausible_variant(sources.walks, "walk", seed + 1, number)
        return turning(loop, np.random.default_rng([seed, 103, number]))
    return plausible_variant(sources.walks if sort == "walk" else sources.runs, sort, seed, number)
