"""A Gymnasium vector environment as a `VecEnv` of stable-baselines3."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Floats
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.train.baselines.shared_object import SharedObjectVecEnv


class StableBaselinesVecEnv(SharedObjectVecEnv):
    """`env`, any Gymnasium vector environment with arrays as observations, for stable-baselines3.

    stable-baselines3 resets an environment in the step that ends its episode, and `env` must do the same:
    make it with `autoreset_mode="SameStep"`; KinemimicError for another mode. The infos of step and reset
    are one dictionary per environment, with `terminal_observation` and `TimeLimit.truncated` at the end of
    an episode.
    """

    def __init__(self, env: VectorEnv[Any, Any, Any]) -> None:
        mode = env.metadata.get("autoreset_mode")
        if mode is not AutoresetMode.SAME_STEP:
            found = mode.value if isinstance(mode, AutoresetMode) else mode
            raise KinemimicError(f'autoreset_mode: expected "SameStep", found {found!r}')
        self.env = env
        self._actions: NDArray[Any] | None = None
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)

    def reset(self) -> Floats:
        """Begin new episodes, with the seeds and options that were set; KinemimicError for options that
        differ between environments."""
        if any(options != self._options[0] for options in self._options):
            raise KinemimicError("options: expected the same for every environment, found different ones")
        # Gymnasium's own vector environments take a list of seeds, which its base class does not declare.
        seeds: Any = self._seeds
        observations, infos = self.env.reset(seed=seeds, options=self._options[0] or None)
        self.reset_infos = _split(infos, self.num_envs)
        self._reset_seeds()
        self._reset_options()
        return np.array(observations)

    def step_async(self, actions: NDArray[Any]) -> None:
        self._actions = actions

    def step_wait(self) -> tuple[Floats, Floats, NDArray[np.bool_], list[dict[str, Any]]]:
        observations, rewards, terminated, truncated, infos = self.env.step(self._actions)
        last, last_infos = infos.pop("final_obs", None), infos.pop("final_info", {})
        each, finals = _split(infos, self.num_envs), _split(last_infos, self.num_envs)
        dones, timed_out = terminated | truncated, truncated & ~terminated
        for k in np.flatnonzero(dones):
            # The infos are those of the reset; stable-baselines3 wants those of the step before it.
            self.reset_infos[k] = each[k]
            each[k] = {**finals[k], "terminal_observation": last[k]}
        for info, out in zip(each, timed_out.tolist(), strict=True):
            info["TimeLimit.truncated"] = out
        return np.array(observations), rewards.astype(np.float32), dones, each

    def close(self) -> None:
        self.env.close()

    def get_images(self) -> tuple[NDArray[np.uint8], ...]:
        frames: Any = self.env.render()
        return tuple(frames or ())

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        if attr_name == "render_mode":
            return [self.env.render_mode] * self.num_envs
        return super().get_attr(attr_name, indices)


def _split(infos: dict[str, Any], size: int) -> list[dict[str, Any]]:
    """The infos of each environment: an entry belongs to those that its mask, `_` before its name, says."""
    parts: list[dict[str, Any]] = [{} for _ in range(size)]
    for name, values in infos.items():
        mask = infos.get(f"_{name}")
        if mask is None:
            continue
        each = _split(values, size) if isinstance(values, dict) else values
        for k in np.flatnonzero(mask):
            parts[k][name] = each[k]
    return parts
