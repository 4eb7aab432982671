"""`kinemimic train`: train a policy that imitates the run's motion."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
import torch

from kinemimic.pipeline.cli.options import json_option, ray_option, run_option
from kinemimic.pipeline.cli.printable import echo
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.run_folder.stage import reading
from kinemimic.retarget.formats.gait_json import report_of_run
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.retarget.gate import require_trainable
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.baseline_config import OffPolicy, require_package
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.from_tracker import OBSTACLES
from kinemimic.train.joined import joined
from kinemimic.train.learning_control.corrector import Corrector
from kinemimic.train.options import training_options
from kinemimic.train.ppo.mlp import CPU
from kinemimic.train.ppo.ppo import PpoAlgorithm
from kinemimic.train.ppo.runner import PpoRunner
from kinemimic.train.recovery.learning import learn_recoveries
from kinemimic.train.rollout.tracker_file import tracker_path
from kinemimic.train.runner import checkpoint
from kinemimic.train.runner.base import Algorithm, Runner
from kinemimic.train.runner.checkpoint import CHECKPOINT, CURVES, TrainingState
from kinemimic.train.runner.closing_words import closing_words
from kinemimic.train.runner.device import device_named
from kinemimic.train.runner.policy_file import Imitated, PolicyFile
from kinemimic.train.runner.training_loop import TrainingLoop, is_complete, is_late
from kinemimic.train.sampling.simulators import Simulators, local_cores, simulators
from kinemimic.train.sampling.workers import Workers
from kinemimic.train.scenario.scenario import Scenario
from kinemimic.train.scenario.scenario_file import find_scenario
from kinemimic.train.settings import Settings, settings_for
from kinemimic.train.sim.engines import resolve
from kinemimic.train.sim.options import workers_option
from kinemimic.train.task.timer import Timer, table

PREVIOUS = "checkpoint.previous.safetensors"


def train(
    run: Path,
    *,
    preset_name: str = "default",
    budget: int | None = None,
    minutes: float | None = None,
    seed: int = 0,
    workers: int | None = None,
    engine: str = "auto",
    resume: bool = True,
    anyway: bool = False,
    scenario: Scenario | None = None,
    start: str | None = None,
    teachers: Path | None = None,
    config: TrainConfig | None = None,
    ray: str | None = None,
    device: str = "cpu",
) -> dict[str, Any]:
    """Train on run/motion.json for `budget` samples, in whole rounds; returns the policy's record.

    Without a `budget` of your own, training from a tracker goes on as long as no evaluation walks, up to the
    configuration's `max_budget`.

    Writes a checkpoint twice a minute, at the end and on Ctrl-C. The next call resumes from it unless
    `resume` is False, with the same result as one call, except that each call evaluates its last policy too,
    which may end the training sooner.
    From the first evaluation on, policy.safetensors is the policy of the best evaluation so far, and
    policy.json says whether the training has `finished`; TensorBoard's curves are written beside them.
    A checkpoint of another motion or other settings is kept as checkpoint.previous.safetensors.
    If the gate (retarget/gate.py) refuses the motion, it is not trained on, unless `anyway` is set.

    minutes: training time of all calls together, after which training ends even if the budget is not used up,
    without recoveries.
    workers: simulation processes, by default one per core; for a baseline, threads. They are spawned: call
    this function under `if __name__ == "__main__":` in your own script. engine: see `sim/engines.py`.
    Training may resume with another engine or number of workers, but is bit for bit the same only with the
    same ones.
    scenario: perturbations, obstacles and ground of every episode (`scenario.py`), each with its own draw.
    start: name of a shipped tracker, or folder of one, to start from, with the settings of
    `config/from_tracker.py`. teachers: folder of the policies with which the preset `obstacles` joins it.
    config: your own settings in place of `preset_name`, `seed` and `start`; `budget` and `scenario`, if
    given, replace those in it.
    ray: simulate on a Ray cluster: its address, or "local" to start Ray on this machine; by default one
    worker per core of it. The policy is bit for bit that of as many local processes.
    device: "cuda" updates the networks of DDPG, TD3 and SAC on a GPU. Its rounding differs from the CPU's,
    and SAC draws other actions there.
    """
    if config is not None and teachers is not None:
        raise KinemimicError(
            "train: expected config or teachers, found both; teachers have settings of their own"
        )
    if teachers is not None and run.resolve().is_relative_to(teachers.resolve()):
        raise KinemimicError(
            f"--teachers {teachers}: expected policies outside of {run}, which training replaces; train into "
            "another run folder"
        )
    if config is not None and start is not None:
        raise KinemimicError("train: expected config or start, found both; start has settings of its own")
    if start is not None and tracker_path(start).resolve().parent == run.resolve():
        raise KinemimicError(
            f"--from {start}: expected a policy outside of {run}, which training replaces it in; train into "
            "another run folder"
        )
    timer = Timer()
    with reading(run, "train"), simulators(ray, workers) as where:
        motion = read_motion_json(run / "motion.json")
        require_trainable(run, motion, anyway=anyway)
        settings = settings_for(
            motion,
            preset_name=preset_name,
            seed=seed,
            start=start,
            teachers=teachers,
            config=config,
            budget=budget,
            scenario=scenario,
            report=None if start is None else report_of_run(run, motion),
        )
        count = where.count(workers, settings.config.num_envs)
        return _train(
            run,
            motion,
            settings,
            where,
            count,
            resolve(engine),
            timer,
            minutes=minutes,
            resume=resume,
            device=device_named(device),
        )


def _train(
    run: Path,
    motion: Motion,
    settings: Settings,
    where: Simulators,
    count: int,
    engine: str,
    timer: Timer,
    *,
    minutes: float | None,
    resume: bool,
    device: torch.device,
) -> dict[str, Any]:
    """Train on `where` with `count` workers; the other arguments as in `train`."""
    config = settings.config
    if device != CPU and not isinstance(config.baseline, OffPolicy):
        raise KinemimicError(f"device: expected cpu for the preset {config.preset}, found {device.type}")
    if config.baseline is not None:
        require_package()
        if not where.shares_disk:
            raise KinemimicError(
                f"--ray: expected a preset of our PPO, found {config.preset}: "
                "baselines simulate in the process that learns"
            )
    # A baseline's small products gain little from a second thread, and lose much where a core is busy:
    # threads spin until the last one arrives. With one thread the result does not depend on `workers`.
    threads = min(count, local_cores())
    torch.set_num_threads(threads if config.baseline is None else 1)
    if config.joining is not None:
        if minutes is not None or not where.shares_disk:
            found = "--ray" if minutes is None else "--minutes"
            raise KinemimicError(
                f"--preset {OBSTACLES}: expected lessons of a fixed length here, found {found}"
            )
        return joined(run, motion, settings, threads, engine, timer, resume=resume)
    algorithm = _algorithm(config, motion, engine, count, device)
    if settings.initial is not None:
        assert isinstance(algorithm, PpoAlgorithm)  # noqa: S101 (a tracker's settings have no baseline)
        algorithm.begin_from(settings.initial)
    training = TrainingState(algorithm, reserved=settings.reserved)
    resumed = _resume(run, training, motion, resume=resume)
    seconds = None if minutes is None else 60.0 * minutes
    imitated = Imitated.of_motion(motion, config)
    policy = PolicyFile(run, training, imitated, engine, resumed=resumed)
    if not is_complete(training, seconds):
        with (
            _runner(algorithm, motion, engine, count, where, timer, imitated.phases) as runner,
            _corrector(algorithm, motion, engine, threads) as corrector,
        ):
            loop = TrainingLoop(
                training, runner, imitated, run / CHECKPOINT, timer, seconds, policy, corrector
            )
            loop.run(run / CURVES)
    best, taught = training.best, None
    assert best is not None  # noqa: S101 (a training that is complete has an evaluation)
    if is_late(training, seconds):
        return policy.write(finished=True)
    if config.recovery is not None:
        taught = learn_recoveries(motion, best, config, run, workers=threads, engine=engine)
    return policy.write(finished=True, taught=taught)


def _resume(run: Path, training: TrainingState, motion: Motion, *, resume: bool) -> bool:
    """Go on from the run's checkpoint if it fits and `resume` is set, else set it aside; whether it did.

    KinemimicError for a checkpoint of more samples than the budget.
    """
    saved, config = run / CHECKPOINT, training.algorithm.config
    advice = "delete it or train with --no-resume"
    resumed = (
        resume and saved.exists() and checkpoint.restore(saved, training, motion.identity, advice=advice)
    )
    samples = training.algorithm.progress.samples
    if samples >= config.largest_budget + config.batch:
        raise KinemimicError(
            f"{saved}: expected at most the budget of {config.largest_budget} samples, found {samples}; "
            "train with --no-resume, or into another run folder"
        )
    if saved.exists() and not resumed:
        saved.replace(run / PREVIOUS)
        if resume:
            why = "of another motion or other settings"
            echo(f"{saved} is {why}: kept as {PREVIOUS}; training starts over", err=True)
    return resumed


@contextmanager
def _corrector(algorithm: Algorithm, motion: Motion, engine: str, threads: int) -> Iterator[Corrector | None]:
    """None without learning control in the configuration."""
    if algorithm.config.learning_control is None or not isinstance(algorithm, PpoAlgorithm):
        yield None
        return
    corrector = Corrector(algorithm, motion, engine, threads)
    try:
        yield corrector
    finally:
        corrector.close()


def _algorithm(
    config: TrainConfig, motion: Motion, engine: str, threads: int, device: torch.device
) -> Algorithm:
    if config.baseline is None:
        return PpoAlgorithm(config)
    from kinemimic.train.baselines.runner import BaselineAlgorithm  # noqa: PLC0415 (may not be installed)

    return BaselineAlgorithm(config, motion, engine, threads, device)


@contextmanager
def _runner(
    algorithm: Algorithm,
    motion: Motion,
    engine: str,
    count: int,
    where: Simulators,
    timer: Timer,
    phases: tuple[float, ...],
) -> Iterator[Runner]:
    if isinstance(algorithm, PpoAlgorithm):
        config = algorithm.config
        with Workers(
            motion, config.env, config.num_envs, config.seed, count, engine, where.open_pool
        ) as workers:
            yield PpoRunner(algorithm, workers, timer, phases)
        return
    # The package may not be installed.
    from kinemimic.train.baselines.runner import BaselineAlgorithm, BaselineRunner  # noqa: PLC0415

    assert isinstance(algorithm, BaselineAlgorithm)  # noqa: S101 (narrows the type)
    try:
        yield BaselineRunner(algorithm, timer, phases)
    finally:
        algorithm.env.close()


@click.command("train")
@run_option()
@training_options
@workers_option
@ray_option
@click.option(
    "--resume/--no-resume", default=True, show_default=True, help="Resume from the run's checkpoint."
)
@click.option(
    "--scenario",
    "named",
    metavar="NAME",
    help="Scenario to train in: a shipped one, or a TOML file. Not with --preset obstacles.",
)
@click.option("--profile", is_flag=True, help="Also print what the time was spent on.")
@json_option("Print the policy's record as JSON.")
def command(
    run: Path,
    preset_name: str,
    budget: int | None,
    minutes: float | None,
    seed: int,
    workers: int | None,
    ray: str | None,
    engine: str,
    resume: bool,
    anyway: bool,
    start: str | None,
    teachers: str | None,
    named: str | None,
    profile: bool,
    as_json: bool,
) -> None:
    """Train a policy that imitates the run's motion in Bullet, with PPO or a baseline preset.

    \b
      kinemimic train --run runs/walk --minutes 5
      kinemimic train --run runs/walk --from tracker
      kinemimic train --run runs/walk --preset robust --budget 3M --seed 1
      kinemimic train --run runs/walk --ray
    """
    record = train(
        run,
        preset_name=preset_name,
        budget=budget,
        minutes=minutes,
        seed=seed,
        workers=workers,
        engine=engine,
        resume=resume,
        anyway=anyway,
        scenario=None if named is None else find_scenario(named),
        start=start,
        teachers=None if teachers is None else Path(teachers),
        ray=ray,
    )
    if as_json:
        click.echo(json.dumps(record, indent=2))
    else:
        for line in closing_words(record, run):
            click.echo(line)
        if profile:
            click.echo(table(record["seconds_by"]))
