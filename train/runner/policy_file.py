"""policy.safetensors and policy.json: the best policy so far, from the first evaluation of a training on."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.provenance import provenance
from kinemimic.pipeline.files.store import copy_file, read_json
from kinemimic.pipeline.run_folder.stage import stage
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.evaluation import best, first_walk, selection_phases
from kinemimic.train.rollout.policy import POLICY
from kinemimic.train.runner.checkpoint import TrainingState
from kinemimic.train.task.mirror import mirrored

PREVIOUS_POLICY = "policy.previous.safetensors"


class PolicyFile:
    """The policy of a training in its run folder.

    resumed: False if the training has just begun; a policy of a finished training in the folder is then
    kept as policy.previous.safetensors and .json.
    """

    def __init__(
        self, run: Path, training: TrainingState, motion: Motion, engine: str, *, resumed: bool
    ) -> None:
        self._run, self._path = run, run / POLICY
        self._training, self._motion, self._engine = training, motion, engine
        self._foreign = not resumed

    def write(self, *, finished: bool) -> dict[str, Any]:
        """Write the best policy so far and its record, which is returned.

        finished: whether the training has ended. KeyError without an evaluation.
        """
        record = policy_record(self._training, self._motion, self._engine, finished=finished)
        policy = self._training.best
        assert policy is not None  # noqa: S101 (there is an evaluation, and so a best one)
        if self._foreign and self._finished():
            for suffix in (".json", ".safetensors"):
                if (own := self._path.with_suffix(suffix)).exists():
                    copy_file(own, self._run / Path(PREVIOUS_POLICY).with_suffix(suffix))
        self._foreign = False
        with stage(self._run, "train", unfinished=not finished) as out:
            policy.save(out / POLICY, record)
        return record

    def _finished(self) -> bool:
        """Whether the folder has the policy of a finished training; one that cannot be read might be."""
        if not self._path.exists():
            return False
        try:
            return read_json(self._path.with_suffix(".json"))["finished"] is not False
        except (KinemimicError, OSError, KeyError, TypeError):
            return True


def policy_record(training: TrainingState, motion: Motion, engine: str, *, finished: bool) -> dict[str, Any]:
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
        "best": best(evaluations).to_json(),
        "first_walk": first_walk(evaluations),
        "evaluated_with": {
            "reward": asdict(config.final_reward),
            "start_phases": list(selection_phases(motion, config.env.scenario)),
        },
        "evaluations": [evaluation.to_json() for evaluation in evaluations],
        **training.algorithm.record_extras(),
        "config": config.to_json(),
        "mirrored": mirrored(config.env, Reference(motion)),
        "simulated": motion.simulated,
        "provenance": provenance(
            "train", inputs={"motion": motion.identity}, config=config.to_json(), seed=config.seed
        ),
    }
