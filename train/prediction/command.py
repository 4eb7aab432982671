"""`kinemimic train-predictor`: learn how a motion goes on, and what it is without a sensor's noise."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click
import numpy as np
import torch

from kinemimic.pipeline.arrays import Floats
from kinemimic.pipeline.cli.options import json_option, out_option, seed_option
from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.cli.progress_state import minutes
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.provenance import provenance
from kinemimic.pipeline.files.store import file_hash
from kinemimic.pipeline.run_folder.lock import locked
from kinemimic.retarget.library.library_file import MANIFEST, read_library
from kinemimic.retarget.library.motion_library import MotionLibrary
from kinemimic.train.prediction.accuracy import Errors, accuracy
from kinemimic.train.prediction.fit import (
    DENOISING,
    NOISY_NOW,
    PREDICTION,
    Hyperparameters,
    fit,
    moments,
    noisy_moments,
    usable,
    windows,
)
from kinemimic.train.prediction.predictor import PREDICTOR, Predictor
from kinemimic.train.prediction.regression import Regression

MOMENTS = 400_000
NOISY_SHARE = 0.5  # moments for the denoising, as a share of those for the prediction
THREADS = 2  # of torch: more cores change the order of its sums, and so the last bits


def train_predictor(source: Path, out: Path, *, count: int = MOMENTS, seed: int = 0) -> dict[str, Any]:
    """Fit a predictor to `count` moments of the split "train" of the library in `source`; returns its record.

    Writes predictor.safetensors and predictor.json to `out`. The record has its accuracy on either split.
    KinemimicError without a motion to train on.
    """
    library, identity, began = read_library(source), file_hash(source / MANIFEST), time.monotonic()
    splits = {split: usable(library, library.select(split), NOISY_NOW) for split in ("train", "test")}
    if not len(splits["train"]):
        raise KinemimicError(
            f"{source}: expected loops, or motions of 1.5 s, in the split `train`, found none"
        )
    torch.set_num_threads(THREADS)
    with locked(out):
        predictor = Predictor(_prediction(library, count, seed), _denoising(library, count, seed))
        inputs, config = {"library": identity}, {
            "moments": count, "prediction": asdict(PREDICTION),
            "noisy_moments": _noisy(count), "denoising": asdict(DENOISING),
        }  # fmt: skip
        record = {
            "seed": seed,
            "seconds": round(time.monotonic() - began, 1),
            "subjects": {split: sorted(library.subjects(split)) for split in ("train", "test")},
            "rmse_deg": {
                split: accuracy(predictor, library, motions, seed)
                for split, motions in splits.items()
                if len(motions)
            },
            "provenance": provenance("train-predictor", inputs=inputs, config=config, seed=seed),
        }
        predictor.save(out / PREDICTOR, record)
    return record


def _prediction(library: MotionLibrary, count: int, seed: int) -> Regression:
    motions = usable(library, library.select("train"))
    batches = windows(library, motions, count, np.random.default_rng(seed))
    return _learned("prediction", (moments(*one) for one in batches), count, PREDICTION, seed)


def _denoising(library: MotionLibrary, count: int, seed: int) -> Regression:
    motions, random = usable(library, library.select("train"), NOISY_NOW), np.random.default_rng(seed)
    # What is no gait has no strides over which noise could average out.
    loops = motions[[library.entries[index].cyclic for index in motions]]
    count = _noisy(count)
    batches = windows(library, loops if len(loops) else motions, count, random, NOISY_NOW)
    return _learned("denoising", (noisy_moments(*one, random) for one in batches), count, DENOISING, seed)


def _noisy(count: int) -> int:
    return max(1, round(NOISY_SHARE * count))


def _learned(
    name: str, batches: Iterable[tuple[Floats, Floats]], count: int, how: Hyperparameters, seed: int
) -> Regression:
    """Fit to `count` moments, which come in batches."""
    parts = []
    with progress(f"{name}: moments", count) as bar:
        for seen, coming in batches:
            parts.append((seen, coming))
            bar.advance(len(seen))
    seen, coming = (np.concatenate(column) for column in zip(*parts, strict=True))
    with progress(f"{name}: train", how.epochs * count, unit="moments") as bar:
        return fit(seen, coming, how, seed, bar.advance)


@click.command("train-predictor")
@click.argument("library", type=click.Path(path_type=Path))
@out_option("Folder of the predictor.")
@click.option("--moments", "count", type=click.IntRange(min=1), default=MOMENTS, show_default=True,
              help="Moments of the motions to learn from.")  # fmt: skip
@seed_option()
@json_option("Print predictor.json.")
def command(library: Path, out: Path, count: int, seed: int, as_json: bool) -> None:
    """Learn from the split `train` of LIBRARY (see `kinemimic library`) how a motion goes on for 0.4 s, and
    what it is without a sensor's noise.

    `kinemimic stream` predicts with the networks in datasets/predictor what the tracker looks ahead to.

    \b
      kinemimic library recordings/ --out runs/library --test 07 --variants 5000
      kinemimic train-predictor runs/library --out datasets/predictor
    """
    record = train_predictor(library, out, count=count, seed=seed)
    if as_json:
        click.echo(json.dumps(record, indent=2))
        return
    for split, errors in record["rmse_deg"].items():
        click.echo(f"RMSE of knee and hip on the split `{split}`, degrees:")
        for line in table(errors):
            click.echo(f"  {line}")
    click.echo(f"{out / PREDICTOR}: {count:,} moments in {minutes(record['seconds'])}, seed {seed}")


def table(errors: dict[str, Errors]) -> list[str]:
    """Lines of a table: a row for the predictor and each control, columns by seconds ahead."""
    ahead = list(errors["denoised"])
    lines = [f"{'':10}" + "".join(f"{f'after {seconds} s':>16}" for seconds in ahead)]
    for name, by_time in errors.items():
        cells = (
            f"{by_time[seconds]['knee']:.1f}, {by_time[seconds]['hip']:.1f}" if seconds in by_time else ""
            for seconds in ahead
        )
        lines.append(f"{name:10}" + "".join(f"{cell:>16}" for cell in cells))
    return lines
