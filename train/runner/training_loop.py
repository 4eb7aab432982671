"""Rounds of rollout and update until samples or minutes are spent, with trials and checkpoints between."""

from __future__ import annotations

import time
from pathlib import Path

from torch.utils.tensorboard import SummaryWriter

from kinemimic.pipeline.cli.progress import Bar, progress
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.parallel.interruption import deferred
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import scheduled_at
from kinemimic.train.rollout.evaluation import Evaluation, best, is_due, start_phases
from kinemimic.train.runner import checkpoint
from kinemimic.train.runner.base import OTHER, ROLLOUT, UPDATE, Runner
from kinemimic.train.runner.checkpoint import Training
from kinemimic.train.task.timer import Timer, summed

CHECKPOINT_SECONDS = 30.0
# Where the time between rounds goes.
EVALUATION = "trial"
SAVING = "checkpoint"


def is_over(training: Training, seconds: float | None) -> bool:
    """Whether the budget, or so many seconds of training, are spent."""
    state = training.learner.progress
    late = seconds is not None and sum(state.seconds_by.values()) >= seconds
    return late or state.samples >= training.learner.config.budget


def is_complete(training: Training, seconds: float | None) -> bool:
    """Whether it is over and its last policy was tried."""
    state, trials = training.learner.progress, training.trials
    return is_over(training, seconds) and bool(trials) and trials[-1].samples == state.samples


class Rounds:
    """The way of one training by one practice, which shares the learner and the timer.

    path: of the checkpoint; motion: what is imitated; seconds: of all calls together, after which it stops.
    """

    def __init__(
        self,
        training: Training,
        practice: Runner,
        motion: Motion,
        path: Path,
        timer: Timer,
        seconds: float | None,
    ) -> None:
        self._training, self._practice, self._motion, self._path = training, practice, motion, path
        self._timer, self._seconds = timer, seconds
        self._state = training.learner.progress
        self._config = training.learner.config
        self._earlier = self._state.seconds_by

    def go(self, curves: Path) -> None:
        """To the end, and a checkpoint there; TensorBoard's curves go to the folder `curves`.

        Ctrl-C or SIGTERM: KeyboardInterrupt after the round and a checkpoint; a second one, at once.
        KinemimicError if the learner is spoilt or nothing can be written; the last checkpoint stays.
        """
        state = self._state
        # What was logged after the checkpoint is logged again.
        purge = state.samples + 1 if state.rounds else 0
        try:
            with (
                deferred() as interruption,
                SummaryWriter(curves, purge_step=purge) as board,
                progress("train", self._config.budget) as bar,
            ):
                bar.advance(state.samples)
                self._practice.begin(self._training.figures)
                saved = time.monotonic()
                while not (interruption.asked or is_complete(self._training, self._seconds)):
                    if self._wants_trial():
                        self._try(board)
                    else:
                        self._round(board, bar)
                    # A trial that is due belongs into the checkpoint: its curves are logged once.
                    late = time.monotonic() - saved > CHECKPOINT_SECONDS * self._practice.patience
                    if late and not self._wants_trial():
                        self._save(board)
                        saved = time.monotonic()
                if state.rounds:
                    self._save(board)
                if interruption.asked:
                    raise KeyboardInterrupt(
                        f"training is saved at {state.samples:,} samples; the same command goes on from there"
                        if state.rounds
                        else "training had not begun"
                    )
        except (FloatingPointError, OSError) as error:
            # A full disk stops TensorBoard's curves first; of them strerror tells without a number.
            found = getattr(error, "strerror", None) or error
            kept = f"{self._path} from before stays" if self._path.exists() else "there is no checkpoint yet"
            raise KinemimicError(f"training stopped at {state.samples:,} samples: {found}; {kept}") from None

    def _round(self, board: SummaryWriter, bar: Bar) -> None:
        config, state, trials = self._config, self._state, self._training.trials
        self._timer.lap(OTHER)
        before = dict(self._timer.seconds)
        logged = self._practice.round()
        sampling, updating = (self._timer.seconds[k] - before.get(k, 0.0) for k in (ROLLOUT, UPDATE))
        logged |= {
            "speed/simulation": config.batch / sampling,
            "speed/update_seconds": updating,
            "speed/samples": config.batch / (sampling + updating),
        }
        for name, value in logged.items():
            board.add_scalar(name, value, state.samples)
        state.losses.append(logged["value/normalized_loss"])
        self._spent(OTHER)
        notes: dict[str, object] = {"reward": logged["reward/mean"], "steps": logged["episode/length"]}
        if trials:
            notes["trial"] = f"{trials[-1].frames}/{trials[-1].of}"
        if self._seconds is not None:
            left = max(0.0, self._seconds - sum(state.seconds_by.values()))
            notes["stops in"] = f"{int(left) // 60}:{int(left) % 60:02d}"
        bar.advance(config.batch, **notes)

    def _wants_trial(self) -> bool:
        """Also after an interruption between a round and its trial."""
        done, trials = self._state.samples, self._training.trials
        if not done or (trials and trials[-1].samples == done):
            return False
        return is_due(done - self._config.batch, done) or is_over(self._training, self._seconds)

    def _try(self, board: SummaryWriter) -> None:
        training, practice, samples = self._training, self._practice, self._state.samples
        policy = training.learner.policy()
        # Under the scales that the schedules end with, so that early and late trials compare.
        reward, strength = self._config.final_reward, scheduled_at(self._config.strength, samples)
        run_episodes = practice.run_episodes(
            policy, reward, start_phases(self._motion, self._config.env.scenario)
        )
        robust_return = practice.robust_returns(policy, reward) if strength > 0.0 else ()
        self._spent(EVALUATION)
        trial = Evaluation.of_episodes(
            run_episodes,
            robust_return,
            samples=samples,
            seconds=sum(self._state.seconds_by.values()),
            strength=strength,
            losses=self._state.losses,
        )
        self._state.losses.clear()
        training.trials.append(trial)
        if best(training.trials) is trial:
            training.best = policy
        for name in ("frames", "reward", "knee", "hip"):
            board.add_scalar(f"trial/{name}", getattr(trial, name), samples)
        if trial.robust_return is not None:
            board.add_scalar("trial/endured", trial.robust_return, samples)

    def _spent(self, name: str) -> None:
        self._timer.lap(name)
        self._state.seconds_by = summed(self._earlier, self._practice.seconds())

    def _save(self, board: SummaryWriter) -> None:
        self._spent(OTHER)
        self._training.figures = self._practice.figures()
        # The curves reach as far as the checkpoint, whatever happens next.
        board.flush()
        checkpoint.save(self._path, self._training, self._motion.identity)
        self._spent(SAVING)
