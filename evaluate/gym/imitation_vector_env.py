"""The task as a Gymnasium vector environment: a batch of humanoids, stepped in one call of the engine."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from kinemimic.evaluate.film.render import Picture
from kinemimic.evaluate.gym.picture import picture
from kinemimic.evaluate.gym.task import (
    RENDER_MODES,
    ImitationTask,
    Transition,
    checked_render_mode,
    load_motion,
)
from kinemimic.pipeline.arrays import Array, Floats
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.sim.world import CONTROL_RATE

Bools = NDArray[np.bool_]


class ImitationVectorEnv(VectorEnv[Floats, NDArray[np.float32], Array]):
    """A batch of `ImitationEnv`: `gymnasium.make_vec("kinemimic/Imitation-v0", num_envs=...)`.

    motion, config, engine: as for `ImitationEnv`; max_episode_steps: in place of the configuration's;
    threads: of the native engine, by default one per core; autoreset_mode: an `AutoresetMode` or its value.
    Spaces, seeds, infos, resets and, up to rounding, all numbers are those of a `SyncVectorEnv` of
    `ImitationEnv`: environment k after `reset(seed=s)` equals an `ImitationEnv` after `reset(seed=s + k)`.
    Options of `reset`: `phase`, a number or one for each environment, and `reset_mask` (E,), the environments
    to reset.
    """

    def __init__(
        self,
        num_envs: int,
        motion: Motion | str | Path,
        config: EnvConfig | None = None,
        engine: str = "auto",
        render_mode: str | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
        max_episode_steps: int | None = None,
    ) -> None:
        if num_envs < 1:
            raise KinemimicError(f"num_envs: expected at least 1, found {num_envs}")
        config = config or EnvConfig()
        if max_episode_steps is not None:
            config = replace(config, episode=max_episode_steps)
        cores = len(os.sched_getaffinity(0))
        self.num_envs, self.render_mode = num_envs, checked_render_mode(render_mode)
        self.metadata = {
            "render_modes": list(RENDER_MODES),
            "render_fps": CONTROL_RATE,
            "autoreset_mode": _autoreset_mode(autoreset_mode),
        }
        self._task = ImitationTask(
            num_envs, load_motion(motion), config, engine, min(threads or cores, num_envs)
        )
        self.single_observation_space = self._task.observation_space
        self.single_action_space = self._task.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._randoms = [seeding.np_random()[0] for _ in range(num_envs)]
        self._begun = np.zeros(num_envs, dtype=np.bool_)
        self._ended = np.zeros(num_envs, dtype=np.bool_)  # in the last step, and not reset since

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        """Begin episodes in all environments, or in those of the option `reset_mask`.

        seed: of the first environment, or of each. KinemimicError for a wrong option or number of seeds.
        """
        options = dict(options or {})
        mask = options.pop("reset_mask", None)
        indices = np.flatnonzero(self._mask(mask))
        if isinstance(options.get("phase"), list | tuple | np.ndarray):
            phases = np.asarray(options["phase"])
            options["phase"] = phases[indices] if phases.shape == (self.num_envs,) else phases
        seeds: Sequence[int | None] = [None] * self.num_envs
        if isinstance(seed, int | np.integer):
            seeds = [int(seed) + k for k in range(self.num_envs)]
        elif seed is not None:
            seeds = seed
        if len(seeds) != self.num_envs:
            raise KinemimicError(f"seed: expected one or {self.num_envs}, found {len(seeds)}")
        for k in indices.tolist():
            if seeds[k] is not None:
                self._randoms[k] = seeding.np_random(seeds[k])[0]
        self._begin(indices, options)
        return self._task.observe(), {}

    def _mask(self, mask: object) -> Bools:
        """The option `reset_mask`; all environments if there is none."""
        if mask is None:
            return np.ones(self.num_envs, dtype=np.bool_)
        found = np.asarray(mask)
        if found.shape != (self.num_envs,) or found.dtype != np.bool_ or not found.any():
            raise KinemimicError(
                f"options: expected reset_mask, {self.num_envs} booleans, at least one of them true, found "
                f"{mask!r}"
            )
        return found

    def _begin(self, indices: NDArray[np.intp], options: dict[str, Any] | None = None) -> None:
        self._task.begin(indices, [self._randoms[k] for k in indices], options)
        self._begun[indices], self._ended[indices] = True, False

    def step(  # type: ignore[override] # one type for rewards and ends there
        self, actions: NDArray[np.float32]
    ) -> tuple[Floats, Array, Bools, Bools, dict[str, Any]]:
        """A control step of all environments.

        Environments whose episode ended begin the next one in the next step, which ignores their action and
        gives no reward (NEXT_STEP); in the same step, which leaves `final_obs` and `final_info` in the infos
        (SAME_STEP); or on `reset` with their `reset_mask` (DISABLED). ResetNeeded before `reset`.
        """
        mode, ended = self.metadata["autoreset_mode"], self._ended.copy()
        waiting = ~self._begun | ended if mode is AutoresetMode.DISABLED else ~self._begun
        if waiting.any():
            found = np.flatnonzero(waiting).tolist()
            raise ResetNeeded(f"expected a reset of environments {found}, found none")
        step = self._task.step(actions)
        observations = step.observations
        if mode is AutoresetMode.NEXT_STEP and ended.any():
            step = _without(step, ended)
            observations = self._begun_anew(ended, observations)
        self._ended = step.terminated | step.truncated
        infos: dict[str, Any] = {}
        stepped = ~ended
        if mode is AutoresetMode.SAME_STEP:
            stepped = ~self._ended
            if self._ended.any():
                infos = self._final(step, self._ended.copy())
                observations = self._begun_anew(self._ended.copy(), observations)
        infos |= self._terms(step, stepped)
        return observations, step.rewards, step.terminated, step.truncated, infos

    def _begun_anew(self, which: Bools, observations: Floats) -> Floats:
        """The observations (E, O) after new episodes of some environments."""
        self._begin(np.flatnonzero(which))
        return np.where(which[:, None], self._task.observe(), observations)

    def _terms(self, step: Transition, of: Bools) -> dict[str, Any]:
        """The reward's terms of these environments as Gymnasium batches infos: values, and a mask of each."""
        if not of.any():
            return {}
        values = np.where(of[:, None], step.terms, 0.0)
        terms: dict[str, Any] = {}
        for name, column in zip(self._task.term_names, values.T, strict=True):
            terms |= {name: column.copy(), f"_{name}": of.copy()}
        return {"terms": terms, "_terms": of.copy()}

    def _final(self, step: Transition, ended: Bools) -> dict[str, Any]:
        """`final_obs` and `final_info` of the episodes that ended."""
        observations = np.full(self.num_envs, None, dtype=object)
        for k in np.flatnonzero(ended):
            observations[k] = step.observations[k].copy()
        info = self._terms(step, ended)
        return {
            "final_obs": observations,
            "_final_obs": ended,
            "final_info": info,
            "_final_info": ended.copy(),
        }

    def render(self) -> tuple[Picture, ...] | None:
        """A picture of each environment (`ImitationEnv.render`); None without a render mode."""
        if not self.render_mode:
            return None
        return tuple(picture(self._task.batch, k) for k in range(self.num_envs))

    def close_extras(self, **kwargs: Any) -> None:
        self._task.close()


def _autoreset_mode(mode: AutoresetMode | str) -> AutoresetMode:
    try:
        return AutoresetMode(mode)
    except ValueError:
        modes = ", ".join(known.value for known in AutoresetMode)
        raise KinemimicError(f"autoreset_mode: expected one of {modes}, found {mode!r}") from None


def _without(step: Transition, those: Bools) -> Transition:
    """A step in which these environments only began their episode."""
    return replace(
        step,
        rewards=np.where(those, 0.0, step.rewards),
        terminated=step.terminated & ~those,
        truncated=step.truncated & ~those,
    )
