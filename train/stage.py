"""The stage `train`: a policy that imitates the run's motion."""

from __future__ import annotations

import json
import os
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import torch
from torch.utils.tensorboard import SummaryWriter

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.progress import progress
from kinemimic.pipeline.provenance import provenance
from kinemimic.retarget.export_json import motion_from_json
from kinemimic.retarget.gate import admit
from kinemimic.retarget.motion import Motion
from kinemimic.train import checkpoint
from kinemimic.train.config import PRESETS, preset
from kinemimic.train.engines import ENGINES, resolve
from kinemimic.train.networks import export
from kinemimic.train.ppo import Learner
from kinemimic.train.rollout import Samples, Workers
from kinemimic.train.stopwatch import Stopwatch, split, summed, table

CHECKPOINT = "checkpoint.safetensors"
PREVIOUS = "checkpoint.previous.safetensors"
POLICY = "policy.safetensors"
CHECKPOINT_SECONDS = 60.0
# Where a round's time goes; the workers say what became of the rollout's.
ROLLOUT = "rollout"
WAITING = "transfer and waiting"
UPDATE = "update"
SAVING = "checkpoint"
OTHER = "other"
_WARM_UP = 16  # steps of the untrained policy that give the normaliser its first statistics


def train(
    run: Path,
    *,
    preset_name: str = "default",
    budget: int | None = None,
    seed: int = 0,
    workers: int | None = None,
    engine: str = "auto",
    resume: bool = True,
    anyway: bool = False,
) -> dict[str, Any]:
    """Train on run/motion.json for `budget` samples, in whole rounds; returns the policy's record.

    Writes a checkpoint every minute and at the end or on Ctrl-C, from which the next call goes on unless
    `resume` is False, then policy.safetensors and policy.json, and TensorBoard's curves. A checkpoint of
    another motion or other settings is not taken up but kept as checkpoint.previous.safetensors.
    A motion that the gate (retarget/gate.py) refuses is not trained on unless `anyway`.
    workers: processes that simulate, by default one for every core. They are spawned: a script of one's
    own calls this below `if __name__ == "__main__"`. engine: of `engines.py`; one may go on from another's
    checkpoint.
    """
    watch = Stopwatch()
    engine = resolve(engine)
    motion = motion_from_json(run / "motion.json")
    admit(run, anyway=anyway)
    config = preset(preset_name, seed=seed)
    if budget is not None:
        config = replace(config, budget=budget)
    if config.budget < 1:
        raise KinemimicError(f"expected a budget of at least one sample, found {config.budget}")
    # A worker holds one figure at least.
    count = min(workers or len(os.sched_getaffinity(0)), config.environments)
    torch.set_num_threads(count)
    learner = Learner(config)
    saved = run / CHECKPOINT
    resumed = resume and saved.exists() and checkpoint.restore(saved, learner, motion.identity)
    if learner.progress.samples >= config.budget + config.batch:
        raise KinemimicError(
            f"{saved}: expected at most the budget of {config.budget} samples, found "
            f"{learner.progress.samples}; train with --no-resume, or into another run folder"
        )
    if saved.exists() and not resumed:
        saved.replace(run / PREVIOUS)
    if learner.progress.samples < config.budget:
        # A worker's random numbers go on where they stopped only as far as the round's number tells: a
        # resumed run draws new start phases instead of repeating those of the beginning.
        start = config.seed + 1_000_003 * learner.progress.rounds
        with Workers(motion, config.env, config.environments, start, count, engine) as crew:
            _learn(learner, crew, motion, run, watch, resumed=resumed)
    state = learner.progress
    record = {
        "preset": config.preset,
        "engine": engine,
        "samples": state.samples,
        "exploded": state.exploded,
        "seconds": round(sum(state.seconds_by.values()), 1),
        "seconds_by": {name: round(value, 2) for name, value in state.seconds_by.items()},
        "seed": seed,
        "config": config.to_json(),
        "simulated": motion.simulated,
        "provenance": provenance(
            "train", inputs={"motion": motion.identity}, config=config.to_json(), seed=seed
        ),
    }
    export(learner.net, learner.normalizer).save(run / POLICY, record)
    return record


def _sample(crew: Workers, learner: Learner, steps: int) -> Samples:
    config, samples = learner.config, learner.progress.samples
    policy = export(learner.net, learner.normalizer)
    return crew.sample(policy, learner.noise(), config.reward(samples), config.strength(samples), steps)


def _learn(
    learner: Learner, crew: Workers, motion: Motion, run: Path, watch: Stopwatch, *, resumed: bool
) -> None:
    """Rounds of rollout and update until the budget is spent, with checkpoints on the way and on Ctrl-C."""
    config, state = learner.config, learner.progress
    earlier = state.seconds_by
    last_saved = time.monotonic()

    def spent(name: str) -> None:
        watch.lap(name)
        state.seconds_by = summed(earlier, split(watch.seconds, ROLLOUT, crew.seconds, WAITING))

    def save() -> None:
        spent(OTHER)
        checkpoint.save(run / CHECKPOINT, learner, motion.identity)
        spent(SAVING)

    with (
        SummaryWriter(run / "tensorboard", purge_step=state.samples if resumed else 0) as board,
        progress("train", config.budget) as bar,
    ):
        bar.advance(state.samples)
        try:
            if state.rounds == 0:
                watch.lap(OTHER)
                first = _sample(crew, learner, _WARM_UP)
                state.exploded += first.exploded
                watch.lap(ROLLOUT)
                learner.normalizer.update(first.observations.reshape(-1, first.observations.shape[-1]))
            while state.samples < config.budget:
                watch.lap(OTHER)
                samples = _sample(crew, learner, config.horizon)
                sampling = watch.lap(ROLLOUT)
                logged = learner.update(samples)
                updating = watch.lap(UPDATE)
                state.exploded += samples.exploded
                logged |= {
                    "simulation/exploded": samples.exploded,
                    "speed/simulation": config.batch / sampling,
                    "speed/update_seconds": updating,
                    "speed/samples": config.batch / (sampling + updating),
                }
                for name, value in logged.items():
                    board.add_scalar(name, value, state.samples)
                bar.advance(config.batch, reward=logged["reward/mean"], steps=logged["episode/length"])
                if time.monotonic() - last_saved > CHECKPOINT_SECONDS:
                    save()
                    last_saved = time.monotonic()
        except FloatingPointError as error:
            # The learner is spoilt; the checkpoint from before it stays.
            raise KinemimicError(
                f"training stopped at {state.samples} samples: {error}; an earlier checkpoint stays"
            ) from None
        except KeyboardInterrupt:
            if state.rounds:
                save()
            raise
    save()


@click.command("train")
@click.option(
    "--run", "run", type=click.Path(path_type=Path), default=Path("runs/default"), show_default=True
)
@click.option(
    "--preset", "preset_name", type=click.Choice(list(PRESETS)), default="default", show_default=True
)
@click.option(
    "--budget", type=click.IntRange(min=1), help="Samples (control steps); the preset's by default."
)
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True)
@click.option("--workers", type=click.IntRange(min=1), help="Processes that simulate; all cores by default.")
@click.option(
    "--engine",
    type=click.Choice(ENGINES),
    default="auto",
    show_default=True,
    help="Native where it is built.",
)
@click.option(
    "--resume/--no-resume", default=True, show_default=True, help="Go on from the run's checkpoint."
)
@click.option("--anyway", is_flag=True, help="Train on a motion that the gate before training refuses.")
@click.option("--json", "as_json", is_flag=True, help="Print the policy's record as JSON.")
def command(
    run: Path,
    preset_name: str,
    budget: int | None,
    seed: int,
    workers: int | None,
    engine: str,
    resume: bool,
    anyway: bool,
    as_json: bool,
) -> None:
    """Train a policy that imitates the run's motion in Bullet (PPO)."""
    record = train(
        run,
        preset_name=preset_name,
        budget=budget,
        seed=seed,
        workers=workers,
        engine=engine,
        resume=resume,
        anyway=anyway,
    )
    if as_json:
        click.echo(json.dumps(record, indent=2))
    else:
        rate = record["samples"] / max(record["seconds"], 1e-9)
        click.echo(
            f"{record['samples']:,} samples in {record['seconds']:.0f} s ({rate:,.0f}/s), preset "
            f"{record['preset']}, seed {record['seed']}, {record['engine']} engine: {run / POLICY}"
        )
        if record["exploded"]:
            click.echo(f"{record['exploded']:,} figures exploded in the simulation and were set back")
        click.echo(table(record["seconds_by"]))
