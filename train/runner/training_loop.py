"""The training loop: rounds until time or samples are spent, with evaluations and checkpoints in between."""

from __future__ import annotations

import time
from pathlib import Path

from torch.utils.tensorboard import SummaryWriter

from kinemimic.pipeline.cli.progress import Bar, progress
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.parallel.interruption import Interruption, deferred
from kinemimic.train.config.config import scheduled_at
from kinemimic.train.learning_control.corrector import Corrector
from kinemimic.train.rollout.evaluation import Evaluation, best, fit, is_due
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.runner import checkpoint
from kinemimic.train.runner.base import OTHER, ROLLOUT, UPDATE, Runner
from kinemimic.train.runner.checkpoint import TrainingState
from kinemimic.train.runner.policy_file import Imitated, PolicyFile
from kinemimic.train.task.timer import Timer, summed

CHECKPOINT_SECONDS = 30.0
# Purposes of the time between rounds.
EVALUATION = "evaluation"
LEARNING_CONTROL = "learning control"
SAVING = "checkpoint"


def is_over(training: TrainingState, seconds: float | None) -> bool:
    """Whether the rounds have ended: a corrected policy fits, the time is up, or the samples are spent (the
    budget if an evaluation walks, else the largest budget). A correction may follow."""
    config, samples = training.algorithm.config, training.algorithm.progress.samples + training.reserved
    if is_late(training, seconds) or _fits(training) or samples >= config.largest_budget:
        return True
    return samples >= config.budget and any(evaluation.walks for evaluation in training.evaluations)


def is_complete(training: TrainingState, seconds: float | None) -> bool:
    """Whether the training has ended and its last policy was evaluated, or corrected."""
    if not is_over(training, seconds) or awaits_correction(training, seconds):
        return False
    return bool(training.evaluations) and _is_judged(training)


def awaits_correction(training: TrainingState, seconds: float | None) -> bool:
    """Whether a correction is next: before the first round, between rounds, or after the last evaluation."""
    state = training.algorithm.progress
    if training.algorithm.config.learning_control is None or is_late(training, seconds) or _fits(training):
        return False
    if not _is_judged(training) or state.samples == state.corrected_at:
        return False
    return is_over(training, seconds) or _interval_is_over(training)


def _interval_is_over(training: TrainingState) -> bool:
    """Whether the first correction is due, or one between the rounds."""
    settings, state = training.algorithm.config.learning_control, training.algorithm.progress
    if settings is None:
        return False
    if state.corrected_at is None:
        return True
    return 0 < settings.interval <= state.samples - state.corrected_at


def is_late(training: TrainingState, seconds: float | None) -> bool:
    """Whether the time is up."""
    return seconds is not None and sum(training.algorithm.progress.seconds_by.values()) >= seconds


def _fits(training: TrainingState) -> bool:
    """Whether a policy reaches the goal of learning control."""
    settings = training.algorithm.config.learning_control
    return settings is not None and any(
        evaluation.walks and min(evaluation.knee, evaluation.hip) >= settings.goal
        for evaluation in training.evaluations
    )


def _is_judged(training: TrainingState) -> bool:
    """Whether the current policy was evaluated or corrected."""
    state, evaluations = training.algorithm.progress, training.evaluations
    if state.samples == state.corrected_at:
        return True
    return bool(evaluations) and evaluations[-1].samples == state.samples


class TrainingLoop:
    """One training with one runner, which shares the algorithm and the timer.

    imitated: what it imitates; path: of the checkpoint; seconds: of all calls together, after which it
    stops; policy: is written after every evaluation and checkpoint; corrector: of a configuration with
    learning control.
    """

    def __init__(
        self,
        training: TrainingState,
        runner: Runner,
        imitated: Imitated,
        path: Path,
        timer: Timer,
        seconds: float | None,
        policy: PolicyFile,
        corrector: Corrector | None = None,
    ) -> None:
        self._corrector = corrector
        self._training, self._runner, self._imitated, self._path = training, runner, imitated, path
        self._timer, self._seconds, self._policy = timer, seconds, policy
        self._state = training.algorithm.progress
        self._config = training.algorithm.config
        self._earlier = self._state.seconds_by

    def run(self, curves: Path) -> None:
        """Train to the end and write a checkpoint; TensorBoard's curves go to the folder `curves`.

        Ctrl-C, SIGTERM or SIGHUP raises KeyboardInterrupt after the round and a checkpoint, a second one at
        once.
        KinemimicError if weights became invalid or nothing can be written; the last checkpoint stays.
        """
        state = self._state
        # Curves logged after the checkpoint are logged again.
        purge = state.samples + 1 if state.samples else 0
        try:
            with (
                deferred() as interruption,
                SummaryWriter(curves, purge_step=purge) as board,
                progress("train", self._config.budget, done=state.samples, unit="samples") as bar,
            ):
                if self._seconds is not None:
                    bar.ends_within(self._seconds - sum(state.seconds_by.values()))
                self._runner.start(self._training.env_states)
                self._show_total(bar)
                saved = time.monotonic()
                while not (interruption.asked or is_complete(self._training, self._seconds)):
                    if awaits_correction(self._training, self._seconds):
                        self._correct(board, bar, interruption)
                    elif self._evaluation_is_due():
                        self._evaluate(board)
                        self._show_total(bar)
                    else:
                        self._round(board, bar)
                    # A due evaluation belongs in the checkpoint, so that its curves are logged once.
                    interval = CHECKPOINT_SECONDS * self._runner.checkpoint_interval_factor
                    late = time.monotonic() - saved > interval
                    if late and not self._evaluation_is_due():
                        self._save(board)
                        saved = time.monotonic()
                if state.samples:
                    self._save(board)
                if interruption.asked:
                    raise KeyboardInterrupt(
                        f"training is saved at {state.samples:,} samples; the same command resumes it"
                        if state.samples
                        else "training had not begun"
                    )
        except (FloatingPointError, OSError) as error:
            # A full disk stops TensorBoard's curves first; strerror leaves out the error number.
            found = getattr(error, "strerror", None) or error
            kept = f"the last {self._path} is kept" if self._path.exists() else "there is no checkpoint yet"
            raise KinemimicError(f"training stopped at {state.samples:,} samples: {found}; {kept}") from None

    def _show_total(self, bar: Bar) -> None:
        """Show how far training goes once it goes on beyond its budget."""
        rest = self._config.budget - self._training.reserved
        if self._state.samples >= rest and not is_over(self._training, self._seconds):
            bar.corrected(self._config.largest_budget)

    def _round(self, board: SummaryWriter, bar: Bar) -> None:
        config, state, evaluations = self._config, self._state, self._training.evaluations
        self._timer.lap(OTHER)
        before = dict(self._timer.seconds)
        logged = self._runner.round()
        sampling, updating = (self._timer.seconds[k] - before.get(k, 0.0) for k in (ROLLOUT, UPDATE))
        logged |= {
            "speed/simulation": config.batch / sampling,
            "speed/update_seconds": updating,
            "speed/samples": config.batch / (sampling + updating),
        }
        for name, value in logged.items():
            board.add_scalar(name, value, state.samples)
        state.losses.append(logged["value/normalized_loss"])
        self._lap(OTHER)
        shown: dict[str, object] = {"reward": logged["reward/mean"]}
        if "episode/length" in logged:
            shown["steps"] = logged["episode/length"]
        if evaluations:
            shown["upright"] = f"{evaluations[-1].frames}/{evaluations[-1].of}"
        bar.advance(config.batch, **shown)

    def _evaluation_is_due(self) -> bool:
        """Also after an interruption between a round and its evaluation."""
        samples = self._state.samples
        if _is_judged(self._training):
            return False
        if not samples:
            return self._corrector is not None
        before, rest = samples - self._config.batch, self._config.budget - self._training.reserved
        control = self._config.learning_control
        if control is not None and control.interval:
            due = _interval_is_over(self._training)  # each correction follows an evaluation
        else:
            due = is_due(before, samples, self._runner.evaluation_interval)
        return due or before < rest <= samples or is_over(self._training, self._seconds)

    def _correct(self, board: SummaryWriter, bar: Bar, interruption: Interruption) -> None:
        """Go on from the corrected policy if it is better; nothing changes if interrupted.

        A policy that falls is not corrected: its errors are not those of a cycle.
        """
        corrector, state = self._corrector, self._state
        assert corrector is not None  # noqa: S101 (the configuration has learning control)
        taken = 0

        def proceed(samples: int) -> bool:
            nonlocal taken
            taken += samples
            bar.advance(samples)
            return not interruption.asked

        before = self._training.evaluations[-1]
        self._timer.lap(OTHER)
        corrected = None if before.falls else corrector.correct(proceed)
        if interruption.asked:
            return
        self._lap(LEARNING_CONTROL)
        state.samples += taken
        state.corrected_at = state.samples
        if corrected is None:
            return
        found = self._evaluation(corrected, corrected=True)
        if fit(found) > fit(before):
            corrector.adopt(corrected)
            self._keep(board, found)

    def _evaluate(self, board: SummaryWriter) -> None:
        """Evaluate the current policy, and keep it if it is the best."""
        self._keep(board, self._evaluation(self._training.algorithm.policy()))

    def _evaluation(self, policy: Policy, *, corrected: bool = False) -> Evaluation:
        runner, samples = self._runner, self._state.samples
        # With the scales at the end of their schedules, so that early and late evaluations are comparable.
        reward, strength = self._config.final_reward, scheduled_at(self._config.strength, samples)
        episodes = runner.run_episodes(policy, reward)
        robust_returns = runner.robust_returns(policy, reward) if strength > 0.0 else ()
        self._lap(EVALUATION)
        evaluation = Evaluation.of_episodes(
            episodes,
            robust_returns,
            samples=samples,
            seconds=sum(self._state.seconds_by.values()),
            strength=strength,
            losses=self._state.losses,
            corrected=corrected,
        )
        self._state.losses.clear()
        return evaluation

    def _keep(self, board: SummaryWriter, evaluation: Evaluation) -> None:
        """Record an evaluation of the current policy, and keep the policy if it is the best."""
        training, samples = self._training, evaluation.samples
        training.evaluations.append(evaluation)
        if best(training.evaluations, by_fit=self._config.learning_control is not None) is evaluation:
            training.best = training.algorithm.policy()
        for name in ("frames", "reward", "knee", "hip"):
            board.add_scalar(f"evaluation/{name}", getattr(evaluation, name), samples)
        if evaluation.robust_return is not None:
            board.add_scalar("evaluation/robust_return", evaluation.robust_return, samples)
        self._policy.write(finished=False)

    def _lap(self, name: str) -> None:
        self._timer.lap(name)
        self._state.seconds_by = summed(self._earlier, self._runner.seconds())

    def _save(self, board: SummaryWriter) -> None:
        self._lap(OTHER)
        self._training.env_states = self._runner.env_states()
        # The curves on disk reach at least as far as the checkpoint.
        board.flush()
        checkpoint.save(self._path, self._training, self._imitated.identity)
        if self._training.evaluations:
            self._policy.write(finished=False)
        self._lap(SAVING)
