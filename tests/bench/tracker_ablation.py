"""What each part of the tracker's training is worth: one part changed at a time, on a motion library.

Every variant is trained from random weights, with seeds 0, 1, ... on the first samples of the settings in
`train/config/tracker.py`, and scored on the recorded motions of both parts of the library. Prints a table and
writes OUT/ablation.json. A training that ends this early does not yet fit the joints, so the table has the
share of frames before a fall.
"""

from __future__ import annotations

import statistics
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np

from kinemimic.evaluate.scoring.tracker_command import evaluate_tracker
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import file_hash, read_json, write_json
from kinemimic.retarget.library.library_file import MANIFEST, read_library, write_library
from kinemimic.retarget.library.motion_library import MotionLibrary
from kinemimic.retarget.library.variants import SUBJECT
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.tracker import tracker_config
from kinemimic.train.tracker import motion_sampling
from kinemimic.train.tracker.command import train_tracker

RESULT = "ablation.json"
FULL, RECORDED, UNIFORM = "all parts", "no random variants of the motions", "motions drawn uniformly"


def variants() -> dict[str, TrainConfig]:
    """Settings by the name of what differs; the library or the sampling differs for two of them."""
    full = tracker_config()

    def ahead(*preview: int) -> TrainConfig:
        return replace(full, env=replace(full.env, preview=preview))

    return {
        FULL: full,
        "reference 1 control step ahead, not 1, 4, 12": ahead(1),
        "reference 1 and 4 control steps ahead": ahead(1, 4),
        RECORDED: full,
        UNIFORM: full,
        "layers of 256 and 128, not 512 and 256": replace(full, hidden=(256, 128)),
        "layers of 1024 and 512": replace(full, hidden=(1024, 512)),
    }


def recorded_only(source: Path, folder: Path) -> Path:
    """The library without its random variants, in `folder`."""
    made_from = file_hash(source / MANIFEST)
    if (folder / MANIFEST).exists() and read_json(folder / MANIFEST)["made_from"] == made_from:
        return folder
    library = read_library(source)
    kept = [k for k, entry in enumerate(library.entries) if entry.subject != SUBJECT]
    part = MotionLibrary.of([library.motion(k) for k in kept], [library.entries[k] for k in kept])
    write_library(folder, part, {"made_from": made_from})
    return folder


@contextmanager
def sampling(variant: str) -> Iterator[None]:
    """Draw motions uniformly in that variant, adaptively in all others."""
    floor = motion_sampling.FLOOR
    if variant == UNIFORM:
        motion_sampling.FLOOR = 1.0
    try:
        yield
    finally:
        motion_sampling.FLOOR = floor


def measured(source: Path, out: Path, samples: int, seeds: int, only: Sequence[str]) -> list[dict[str, Any]]:
    """A row for each seed and variant (those in `only`; all if empty); rows that OUT has are not measured
    again."""
    kept = read_json(out / RESULT) if (out / RESULT).exists() else []
    rows = []
    library = file_hash(source / MANIFEST)
    recorded = recorded_only(source, out / "recorded")
    for seed in range(seeds):
        for variant in dict.fromkeys(only) or variants():
            made_by = {"variant": variant, "seed": seed, "budget": samples, "library": library}
            row = next((row for row in kept if made_by.items() <= row.items()), None)
            if row is None:
                folder = out / variant.replace(" ", "-").replace(",", "") / f"seed{seed}"
                row = {**made_by, **trained(source, recorded, folder, variant, samples, seed)}
                kept.append(row)
                write_json(out / RESULT, kept)
            rows.append(row)
    return rows


def trained(
    source: Path, recorded: Path, folder: Path, variant: str, samples: int, seed: int
) -> dict[str, Any]:
    """Train a variant in `folder`, or go on there, and score it on the recorded motions of `source`."""
    trained_on = recorded if variant == RECORDED else source
    with sampling(variant):
        record = train_tracker(trained_on, folder, config=variants()[variant], budget=samples, seed=seed)
    motions = evaluate_tracker(source, str(folder), folder)["motions"]
    shares = {
        f"{kind}_{part}": upright(motions, kind, part)
        for kind in ("walk", "run")
        for part in ("train", "test")
    }
    known = {key: share for key, share in shares.items() if share is not None}
    return {"samples": record["samples"], "seconds": record["seconds"], **known}


def upright(motions: list[dict[str, Any]], kind: str, part: str) -> float | None:
    """Mean share of frames before a fall, of the loops of a kind in a part; None without one."""
    shares = [
        row["frames"] / row["of"]
        for row in motions
        if (row["kind"], row["split"]) == (kind, part) and row["cyclic"]
    ]
    return float(np.mean(shares)) if shares else None


def table(rows: list[dict[str, Any]]) -> str:
    """Means of the seeds, each seed in brackets, in %."""
    keys = [key for key in rows[0] if key.startswith(("walk_", "run_"))]
    lines = ["| " + " | ".join(["", *keys, "seconds"]) + " |", "|" + "---|" * (len(keys) + 2)]
    for variant in dict.fromkeys(row["variant"] for row in rows):
        own = [row for row in rows if row["variant"] == variant]
        cells = [_cell(own, key) for key in keys]
        seconds = statistics.mean(row["seconds"] for row in own)
        lines.append("| " + " | ".join([variant, *cells, f"{seconds:,.0f}"]) + " |")
    return "\n".join(lines)


def _cell(rows: Sequence[dict[str, Any]], key: str) -> str:
    values = [100.0 * row[key] for row in rows]
    return f"{statistics.mean(values):.0f} ({', '.join(f'{value:.0f}' for value in values)})"


@click.command()
@click.argument("library", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.argument("out", type=click.Path(file_okay=False, path_type=Path))
@click.option("--samples", type=click.IntRange(min=1), default=10_800_000, show_default=True,
              help="Of each training; by default a fifth of the first tracker.")  # fmt: skip
@click.option("--seeds", type=click.IntRange(min=1), default=2, show_default=True)
@click.option("--only", multiple=True, type=click.Choice(list(variants())),
              help="Of the variants; repeatable. All by default.")  # fmt: skip
def main(library: Path, out: Path, samples: int, seeds: int, only: tuple[str, ...]) -> None:
    """Train and score every variant on LIBRARY (of `kinemimic library`, with variants and subjects left out
    for tests); resumable: what is in OUT is not done again."""
    try:
        print(table(measured(library, out, samples, seeds, only)))
    except KinemimicError as error:
        sys.exit(f"tracker_ablation: {error}")


if __name__ == "__main__":
    main()
