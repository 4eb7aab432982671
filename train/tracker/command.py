"""`kinemimic train-tracker`: train a policy that performs any motion, on a motion library."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click
import numpy as np
import torch
from numpy.typing import NDArray

from kinemimic.pipeline.cli.options import json_option, out_option, ray_option, seed_option
from kinemimic.pipeline.cli.progress_state import minutes as in_minutes
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import file_hash
from kinemimic.pipeline.run_folder.lock import locked
from kinemimic.retarget.library.library_file import MANIFEST, read_library
from kinemimic.retarget.library.motion_library import MotionLibrary
from kinemimic.train.config.budget import MINUTES, samples
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.tracker import STANDING, START_RATE, TRACKER, TRACKER_PRESETS
from kinemimic.train.reference.reference_library import ReferenceLibrary
from kinemimic.train.rollout.policy import POLICY, Policy
from kinemimic.train.rollout.tracker_file import load_tracker, tracker_path
from kinemimic.train.runner import checkpoint
from kinemimic.train.runner.checkpoint import CHECKPOINT, CURVES, TrainingState
from kinemimic.train.runner.device import device_named, device_option
from kinemimic.train.runner.policy_file import Imitated, PolicyFile
from kinemimic.train.runner.training_loop import TrainingLoop, is_complete
from kinemimic.train.sampling.simulators import Simulators, local_cores, simulators
from kinemimic.train.sim.engines import resolve
from kinemimic.train.sim.options import engine_option, workers_option
from kinemimic.train.task.timer import Timer
from kinemimic.train.tracker.runner import TrackerAlgorithm, TrackerRunner, TrackerWorkers
from kinemimic.train.tracker.tables import reference_tables

EVALUATED = 64  # motions of the split "train"


@dataclass(frozen=True)
class _Beginning:
    """A tracker to start from; samples: it was trained on."""

    policy: Policy
    samples: int


def train_tracker(
    source: Path,
    out: Path,
    *,
    preset: str = TRACKER,
    config: TrainConfig | None = None,
    start: str | None = None,
    budget: int | None = None,
    minutes: float | None = None,
    seed: int = 0,
    workers: int | None = None,
    engine: str = "auto",
    ray: str | None = None,
    device: str = "cpu",
) -> dict[str, Any]:
    """Train a tracker on the split "train" of the library in `source`; returns the policy's record.

    Writes policy.safetensors, policy.json, checkpoint.safetensors and TensorBoard's curves to `out`; the next
    call resumes from the checkpoint, with the same result as one call. The policy that is kept is the best of
    the evaluations on EVALUATED motions of the split "train": no motion of the split "test" chooses it.
    preset: of TRACKER_PRESETS; `standing` trains on the motions without strides alone. config: settings in
    place of the preset's; start: name or folder of a tracker to start from, whose samples count towards the
    budget, which must be larger, and the schedules; budget, minutes, seed, workers, engine, ray: as for
    `train`; device: "cuda" updates the networks on a GPU, whose rounding differs from the CPU's.
    KinemimicError without a motion to train on or without that GPU, and for a checkpoint of another library
    or other settings.
    """
    updated_on = device_named(device)
    config = replace(config or TRACKER_PRESETS[preset](), seed=seed)
    if budget is not None:
        config = replace(config, budget=budget)
    begin = None
    if start is not None:
        begin, config = _from(start, config, out)
    with locked(out), simulators(ray, workers) as where:
        count = where.count(workers, config.num_envs)
        return _train(source, out, config, begin, where, count, resolve(engine), updated_on, minutes)


def _from(start: str, config: TrainConfig, out: Path) -> tuple[_Beginning, TrainConfig]:
    """The tracker to start from, and the settings to go on with; KinemimicError if its network is another, if
    it leaves nothing to train, or if it is the one in `out`."""
    path = tracker_path(start)
    if path.resolve().parent == out.resolve():
        raise KinemimicError(
            f"--from {start}: expected a tracker outside of {out}, which training replaces it in; choose "
            "another --out"
        )
    policy, record = load_tracker(path)
    settings = TrainConfig.from_json(record["config"], path.with_suffix(".json"), ("config",))
    if settings.env.observed_obstacles:
        raise KinemimicError(
            f"{path}: expected a tracker without obstacles in its observation, found one with "
            f"{settings.env.observed_obstacles}; choose another --from"
        )
    if (settings.env.preview, settings.hidden) != (config.env.preview, config.hidden):
        raise KinemimicError(
            f"{path}: expected a tracker with layers of {config.hidden} and a preview of "
            f"{config.env.preview} control steps, found {settings.hidden} and {settings.env.preview}; "
            "choose another --from"
        )
    begin = _Beginning(policy, record["samples"])
    if begin.samples >= config.budget:
        raise KinemimicError(
            f"{path}: expected a --budget above its {begin.samples:,} samples, which count towards it, found "
            f"{config.budget:,}"
        )
    return begin, replace(config, start=file_hash(path), actor_rate=START_RATE)


def _train(
    source: Path,
    out: Path,
    config: TrainConfig,
    begin: _Beginning | None,
    where: Simulators,
    count: int,
    engine: str,
    device: torch.device,
    minutes: float | None,
) -> dict[str, Any]:
    """Train on `where` with `count` workers; the other arguments as in `train_tracker`."""
    timer, library, identity = Timer(), read_library(source), file_hash(source / MANIFEST)
    trained = _trained(library, config, source)
    torch.set_num_threads(min(count, local_cores()))
    algorithm = TrackerAlgorithm(config, len(trained), device)
    if begin is not None:
        algorithm.begin_from(begin.policy)
        algorithm.progress.samples = begin.samples
    training, saved = TrainingState(algorithm), out / CHECKPOINT
    advice = "delete it or choose another --out"
    resumed = saved.exists() and checkpoint.restore(saved, training, identity, advice=advice)
    if saved.exists() and not resumed:
        raise KinemimicError(
            f"{saved}: expected a checkpoint of this library and these settings, found another; "
            "choose another --out"
        )
    simulated = any(library.entries[index].simulated for index in trained)
    imitated = Imitated("library", identity, (), config.env.mirror, simulated)
    policy = PolicyFile(out, training, imitated, engine, resumed=resumed)
    seconds = None if minutes is None else 60.0 * minutes
    if not is_complete(training, seconds):
        tables = reference_tables(library, trained, out, identity)
        shipped = tables if where.shares_disk else ReferenceLibrary.open(tables)
        with TrackerWorkers(shipped, config, count, engine, where.open_pool) as samplers:
            runner = TrackerRunner(algorithm, samplers, timer, _evaluated(len(trained), config.seed))
            TrainingLoop(training, runner, imitated, saved, timer, seconds, policy).run(out / CURVES)
    return policy.write(finished=True)


def _trained(library: MotionLibrary, config: TrainConfig, source: Path) -> NDArray[np.intp]:
    """Motions (N,) of the split "train" that these settings are for."""
    trained = library.select("train")
    if not len(trained):
        raise KinemimicError(f"{source}: expected motions to train on, found only those left out for tests")
    if config.preset != STANDING:
        return trained
    still = trained[[library.entries[index].kind == "motion" for index in trained]]
    if not len(still):
        raise KinemimicError(
            f"{source}: expected motions without strides to train on, found walks and runs; "
            "`kinemimic library --exercises 3000` adds some"
        )
    return still


def _evaluated(count: int, seed: int) -> NDArray[np.intp]:
    """Motions of the evaluations: EVALUATED of them, drawn by the seed."""
    return np.sort(np.random.default_rng(seed).permutation(count)[:EVALUATED])


@click.command("train-tracker")
@click.argument("library", type=click.Path(path_type=Path))
@out_option("Folder of the policy and its checkpoint.")
@click.option("--preset", type=click.Choice(list(TRACKER_PRESETS)), default=TRACKER, show_default=True,
              help="tracker: any motions; standing: those without strides, on the spot.")  # fmt: skip
@click.option("--from", "start", metavar="POLICY",
              help="Start from this tracker, a name or a folder; --budget includes its samples.")  # fmt: skip
@click.option("--budget", type=samples, help="Samples (control steps) in total. Default: the preset's.")
@click.option("--minutes", type=MINUTES, help="Stop after this training time, of all calls together.")
@seed_option()
@device_option("Where the networks are updated; with cuda, results differ by rounding.")
@engine_option
@workers_option
@ray_option
@json_option("Print the policy's record as JSON.")
def command(
    library: Path,
    out: Path,
    preset: str,
    start: str | None,
    budget: int | None,
    minutes: float | None,
    seed: int,
    workers: int | None,
    ray: str | None,
    engine: str,
    device: str,
    as_json: bool,
) -> None:
    """Train one policy for any motion on the split `train` of LIBRARY (see `kinemimic library`).

    Takes hours; Ctrl-C saves, and the same command resumes.

    \b
      kinemimic library recordings/ --out runs/library --test 07 --variants 6000
      kinemimic train-tracker runs/library --out runs/tracker --budget 60M
    """
    record = train_tracker(
        library, out, preset=preset, start=start, budget=budget, minutes=minutes, seed=seed, workers=workers,
        engine=engine, ray=ray, device=device,
    )  # fmt: skip
    if as_json:
        click.echo(json.dumps(record, indent=2))
        return
    best = record["best"]
    click.echo(
        f"performs {best['completed']} of {best['episodes']} motions of the split `train` to their end, "
        f"after {best['samples']:,} samples"
    )
    click.echo(
        f"{out / POLICY}: {record['samples']:,} samples "
        + ("" if start is None else "(including those of --from) ")
        + f"in {in_minutes(record['seconds'])}, seed {seed}\n"
        f"`kinemimic run CAPTURE --policy {out}` performs a capture with it."
    )
