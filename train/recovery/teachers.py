"""Policies trained among obstacles, which teach how to walk through them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import content_hash
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.rollout.policy import Policy, read_record
from kinemimic.train.task.env import ImitationBatch
from kinemimic.train.task.view import View, same_actions


@dataclass(frozen=True)
class Teachers:
    """Policies of one task; env: that task. Together they act by the mean of their actions.

    Seeds that learned the same task make different mistakes, and their mean makes fewer
    (docs/results-pushes.md).
    """

    policies: tuple[Policy, ...]
    env: EnvConfig

    @property
    def identity(self) -> str:
        """Content hash of all policies, in their order."""
        return content_hash(
            {
                f"{k}.{name}": tensor
                for k, policy in enumerate(self.policies)
                for name, tensor in policy.tensors().items()
            }
        )


class TaughtActions:
    """The teachers' actions in the states of a batch of another task."""

    def __init__(self, batch: ImitationBatch, teachers: Teachers) -> None:
        self._view, self._policies = View(batch, teachers.env), teachers.policies

    def act(self) -> Array:
        """Actions (E, 42), as `ImitationBatch.step` takes them, in the batch's current state."""
        seen = self._view.observe()
        return self._view.translated(np.mean([policy.act(seen) for policy in self._policies], axis=0))


def load_teachers(folder: Path, pupil: EnvConfig) -> Teachers:
    """The policies in a folder and those below it, of each folder the one of the most samples.

    KinemimicError unless they were trained among obstacles, all in the same task, and their actions mean the
    same as in the task of the pupil.
    """
    where = f"--teachers {folder}"
    policies, tasks = [], []
    for path in _longest_trained(folder):
        policy, record = Policy.load(path)
        env = TrainConfig.from_json(record["config"], path.with_suffix(".json"), ("config",)).env
        if env.scenario is None or not env.scenario.obstacles:
            raise KinemimicError(
                f"{path}: expected a policy trained in a scenario with obstacles, found one that was not"
            )
        policies.append(policy)
        tasks.append(env)
    if not policies:
        raise KinemimicError(
            f"{where}: expected a folder with policies trained among obstacles, found none; "
            "`kinemimic compare RUN@several-obstacles --preset td3 --seeds 3 --budgets 1e6` trains three"
        )
    if any(env != tasks[0] for env in tasks):
        raise KinemimicError(f"{where}: expected policies of one task, found several")
    if tasks[0].observed_obstacles:
        raise KinemimicError(f"{where}: expected policies that do not observe obstacles, found some that do")
    if not same_actions(tasks[0], pupil):
        raise KinemimicError(f"{where}: expected policies whose actions correct the reference, found others")
    return Teachers(tuple(policies), tasks[0])


def _longest_trained(folder: Path) -> list[Path]:
    """Of each folder with policies, the one of the most samples; none of what a run folder has set aside."""
    longest: dict[Path, tuple[int, Path]] = {}
    for path in sorted(folder.rglob("policy*.safetensors")):
        aside = {"outdated", "simulate"} & set(path.relative_to(folder).parts)
        if ".previous" not in path.suffixes and not aside:
            samples = read_record(path.with_suffix(".json")).get("samples")
            rank = samples if isinstance(samples, int) else 0
            longest[path.parent] = max(longest.get(path.parent, (-1, path)), (rank, path))
    return [path for _, path in longest.values()]
