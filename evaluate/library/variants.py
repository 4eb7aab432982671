"""The random variants of a motion library: how many of each sort, and their making in parallel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.parallel.task_pool import parallel_map
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.library.exercises import exercise
from kinemimic.retarget.library.motion_library import Entry
from kinemimic.retarget.library.turning import turning
from kinemimic.retarget.library.variants import SUBJECT, plausible, plausible_variant
from kinemimic.retarget.optimise.balance_loop import balance_loop
from kinemimic.train.reference.residual import residual

# Of the variants, by sort; walks are the rest.
SHARES = {"run": 0.25, "turning": 0.05}
# `kind` of a variant's entry.
KINDS = {"walk": "walk", "run": "run", "turning": "walk", "exercise": "motion"}
CHUNK = 20  # variants of a task
# Largest `residual` of a variant: few walks and runs that were recorded have a larger one, and those from a
# noisy Kinect. Without this, much of a tracker's training would go to motions that nobody can perform.
LARGEST_RESIDUAL = {"walk": 0.25, "run": 0.65}
# Brisk walks need more: with one limit for all speeds, hardly any variant would be brisk. m/s, and 1/(m/s).
BRISK, PER_SPEED = 1.2, 0.2
# Probability that a walk is balanced, as a depth sensor's walks are before a tracker performs them.
BALANCED = 0.5


@dataclass(frozen=True)
class Loops:
    """The loops of the split "train" that are varied."""

    walks: Sequence[Motion]
    runs: Sequence[Motion]

    @classmethod
    def of(cls, motions: Sequence[Motion], entries: Sequence[Entry]) -> Loops:
        """Those of the split "train" among motions."""
        found: dict[str, list[Motion]] = {"walk": [], "run": []}
        for motion, entry in zip(motions, entries, strict=True):
            if entry.split == "train" and entry.cyclic and entry.kind in found:
                found[entry.kind].append(motion)
        return cls(found["walk"], found["run"])

    def counts(self, count: int) -> dict[str, int]:
        """How many of `count` variants there are of each sort; KinemimicError without a loop."""
        if not count:
            return {}
        if not (self.walks or self.runs):
            raise KinemimicError("--variants: expected walks or runs to vary, found no loops")
        if not self.walks:
            return {"run": count}
        counts = {"turning": round(SHARES["turning"] * count)}
        if self.runs:
            counts["run"] = round(SHARES["run"] * count)
        return {**counts, "walk": count - sum(counts.values())}


def made_variants(
    motions: Sequence[Motion], entries: Sequence[Entry], count: int, exercises: int, seed: int, jobs: int
) -> list[tuple[Motion, Entry]]:
    """`count` variants of the loops of the split "train", and random exercises on the spot; the same for
    the same motions, numbers and seed."""
    loops = Loops.of(motions, entries)
    counts = {**loops.counts(count), "exercise": exercises}
    tasks = [
        (loops, sort, seed, range(first, min(first + CHUNK, number)))
        for sort, number in counts.items()
        for first in range(0, number, CHUNK)
    ]
    if not tasks:
        return []
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


def _make(task: tuple[Loops, str, int, range]) -> list[Motion]:
    loops, sort, seed, numbers = task
    return [_variant(loops, sort, seed, number) for number in numbers]


def _variant(loops: Loops, sort: str, seed: int, number: int) -> Motion:
    if sort == "exercise":
        return exercise(seed, number)
    if sort == "run":
        return plausible_variant(loops.runs, "run", seed, number, _physical)
    random = np.random.default_rng([seed, 103, number])
    # Loops of their own for turning walks, apart from those of the others.
    loop = plausible_variant(loops.walks, "walk", seed + (sort == "turning"), number, _physical)
    if random.random() < BALANCED:
        moved, _ = balance_loop(loop)
        loop = moved if plausible(moved, "walk") and _physical(moved, "walk") else loop
    return turning(loop, random) if sort == "turning" else loop


def _physical(motion: Motion, kind: str) -> bool:
    return residual(motion) <= largest_residual(kind, motion.cycle_offset[0] / motion.duration)


def largest_residual(kind: str, speed: float) -> float:
    """Of a variant ("walk" or "run") at a speed in m/s."""
    return LARGEST_RESIDUAL[kind] + (PER_SPEED * max(0.0, speed - BRISK) if kind == "walk" else 0.0)
