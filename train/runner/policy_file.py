"""policy.safetensors and policy.json: the best policy so far, from the first evaluation on."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.provenance import provenance
from kinemimic.pipeline.files.store import copy_file, read_json
from kinemimic.pipeline.run_folder.stage import stage
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.recovery.learning import Taught
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.evaluation import best, first_walk, selection_phases
from kinemimic.train.rollout.policy import POLICY
from kinemimic.train.runner.checkpoint import TrainingState
from kinemimic.train.task.mirror import mirrored

PREVIOUS_POLICY = "policy.previous.safetensors"


@dataclass(frozen=True)
class Imitated:
    """What a training run imitates.

    source: "motion" or "library"; identity: its content hash; phases: start phases of the evaluations;
    mirrored: whether the policy mirrors; simulated: whether it is of a simulated capture.
    """

    source: str
    identity: str
    phases: tuple[float, ...]
    mirrored: bool
    simulated: bool

    @classmethod
    def of_motion(cls, motion: Motion, config: TrainConfig) -> Imitated:
        """A motion, in the task of a configuration."""
        episodes = {} if config.learning_control is None else {"episodes": config.learning_control.episodes}
        phases = selection_phases(motion, config.env.scenario, **episodes)
        mirrors = mirrored(config.env, Reference(motion))
        return cls("motion", motion.identity, phases, mirrors, motion.simulated)


class PolicyFile:
    """The policy of a training run in its run folder.

    resumed: False if training has just begun. The policy of a finished training run in the folder is then
    kept as policy.previous.safetensors and .json; so is one that was taught after its training, which the
    checkpoint does not have.
    """

    def __init__(
        self, run: Path, training: TrainingState, imitated: Imitated, engine: str, *, resumed: bool
    ) -> None:
        self._run, self._path = run, run / POLICY
        self._training, self._imitated, self._engine = training, imitated, engine
        self._keeps = not resumed or self._is_taught()

    def write(self, *, finished: bool, taught: Taught | None = None) -> dict[str, Any]:
        """Write the best policy so far and its record, which is returned.

        finished: whether the training has ended; taught: what the best policy became by recoveries or
        joining. KeyError without an evaluation.
        """
        record = policy_record(self._training, self._imitated, self._engine, finished=finished)
        policy = self._training.best
        if taught is not None:
            policy, record[taught.stage] = taught.policy, taught.record
        assert policy is not None  # noqa: S101 (there is an evaluation, and so a best one)
        if self._keeps and self._finished():
            for suffix in (".json", ".safetensors"):
                if (own := self._path.with_suffix(suffix)).exists():
                    copy_file(own, self._run / Path(PREVIOUS_POLICY).with_suffix(suffix))
        self._keeps = False
        with stage(self._run, "train", unfinished=not finished) as out:
            policy.save(out / POLICY, record)
        return record

    def _is_taught(self) -> bool:
        """Whether the folder has a policy that was taught after its training."""
        try:
            return not {"recovery", "joining"}.isdisjoint(read_json(self._path.with_suffix(".json")))
        except (KinemimicError, OSError, TypeError):
            return False

    def _finished(self) -> bool:
        """Whether the folder has the policy of a finished training; one that cannot be read might be."""
        if not self._path.exists():
            return False
        try:
            return read_json(self._path.with_suffix(".json"))["finished"] is not False
        except (KinemimicError, OSError, KeyError, TypeError):
            return True


def policy_record(
    training: TrainingState, imitated: Imitated, engine: str, *, finished: bool
) -> dict[str, Any]:
    """policy.json, except its schema and body."""
    config, state = training.algorithm.config, training.algorithm.progress
    evaluations = training.evaluations
    return {
        "preset": config.preset,
        "engine": engine,
        "samples": state.samples,
        "finished": finished,
        "exploded": state.exploded,
        "seconds": round(sum(state.seconds_by.values()), 1),
        "seconds_by": {name: round(value, 2) for name, value in state.seconds_by.items()},
        "seed": config.seed,
        "best": best(evaluations, by_fit=config.learning_control is not None).to_json(),
        "first_walk": first_walk(evaluations),
        "evaluated_with": {
            "reward": asdict(config.final_reward),
            "start_phases": list(imitated.phases),
        },
        "evaluations": [evaluation.to_json() for evaluation in evaluations],
        **training.algorithm.record_extras(),
        "config": config.to_json(),
        "mirrored": imitated.mirrored,
        "simulated": imitated.simulated,
        "provenance": provenance(
            "train", inputs={imitated.source: imitated.identity}, config=config.to_json(), seed=config.seed
        ),
    }
