"""A batch as a policy of another task sees it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.sim.world import CONTROL_RATE
from kinemimic.train.task.env import ImitationBatch
from kinemimic.train.task.mirror import Mirror, mirrored, reflected_rows
from kinemimic.train.task.observation import observe
from kinemimic.train.task.reward import pose_turns


class View:
    """Observes a batch in the task of another configuration, and turns its actions into those of the batch.

    config: of a task whose actions mean the same (`same_actions`) and that observes no obstacles.
    """

    def __init__(self, batch: ImitationBatch, config: EnvConfig) -> None:
        if config.observed_obstacles or not same_actions(config, batch.config):
            raise ValueError("expected a task of the same actions that observes no obstacles")
        self._batch, self._config = batch, replace(config, scenario=None)
        self._mirror = Mirror(self._config) if mirrored(self._config, batch.reference) else None

    def observe(self) -> Array:
        """(E, O) observations of the other task in the batch's current state."""
        batch, config = self._batch, self._config
        increment = 1.0 / (CONTROL_RATE * batch.reference.duration)
        ahead = [batch.reference.bodies(batch.phases + k * increment) for k in config.preview]
        turns, *turns_ahead = pose_turns(batch.bodies, batch.target, *ahead)
        cyclic = batch.reference.cyclic
        seen = observe(config, batch.phases, cyclic, batch.bodies, batch.target, ahead, turns, turns_ahead)
        if self._mirror is not None:
            self._mirror.observations(seen, reflected_rows(config, batch.phases, batch.target))
        return seen

    def translated(self, actions: Array) -> Array:
        """Actions (E, 42) of the other task as `ImitationBatch.step` takes them."""
        batch, unreflected = self._batch, np.array(actions, dtype=np.float64)
        if self._mirror is not None:
            rows = reflected_rows(self._config, batch.phases, batch.target)
            self._mirror.actions(unreflected, rows)
        return batch.reflected(unreflected)  # a reflection is its own inverse


def same_actions(one: EnvConfig, other: EnvConfig) -> bool:
    """Whether an action of one task means the same in the other, except for mirroring."""
    names = ("residual", "velocity_feedforward", "torque_feedforward", "balance")
    return all(getattr(one, name) == getattr(other, name) for name in names)
