"""The task as a Gymnasium environment with one humanoid."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from kinemimic.evaluate.film.render import Picture
from kinemimic.evaluate.gym.picture import picture
from kinemimic.evaluate.gym.task import RENDER_MODES, ImitationTask, checked_render_mode, load_motion
from kinemimic.pipeline.arrays import Floats
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.sim.world import CONTROL_RATE


class ImitationEnv(gym.Env[Floats, NDArray[np.float32]]):
    """Imitate a motion with one humanoid: `gymnasium.make("kinemimic/Imitation-v0", motion=...)`.

    motion: a `Motion`, a motion.json, a run folder, or the name of a shipped policy; config: the task, by
    default `EnvConfig()`; engine: see `sim/engines.py`. Observations (O,): see `observation_layout.py`.
    Actions (42,), in [-1, 1], are those of `ImitationBatch` divided by 0.5. Both are mirrored in the second
    half of a gait cycle, unless the configuration turns `mirror` off. An episode terminates at a fall, or
    when the humanoid leaves its reference; it is truncated at its end, by default after 10 s. Each episode
    draws the configuration's domain randomization at full strength and starts at a random phase, at 0
    without `start_anywhere`, or at p after `reset(options={"phase": p})`. `info["terms"]` has the reward's
    terms. render_mode: None or "rgb_array". Wrong arguments raise a KinemimicError.
    """

    metadata = {"render_modes": list(RENDER_MODES), "render_fps": CONTROL_RATE}  # noqa: RUF012 (Gymnasium's own form)

    def __init__(
        self,
        motion: Motion | str | Path,
        config: EnvConfig | None = None,
        engine: str = "auto",
        render_mode: str | None = None,
    ) -> None:
        self._task = ImitationTask(1, load_motion(motion), config or EnvConfig(), engine)
        self.observation_space, self.action_space = self._task.observation_space, self._task.action_space
        self.render_mode = checked_render_mode(render_mode)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        super().reset(seed=seed)
        self._task.begin(np.array([0]), [self.np_random], options)
        return self._task.observe()[0], {}

    def step(self, action: NDArray[np.float32]) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
        step = self._task.step(np.asarray(action)[None])
        terms = dict(zip(self._task.term_names, step.terms[0].tolist(), strict=True))
        ends = bool(step.terminated[0]), bool(step.truncated[0])
        return step.observations[0], float(step.rewards[0]), *ends, {"terms": terms}

    def render(self) -> Picture | None:
        """The picture of the humanoid and its reference, (480, 480, 3); None without a render mode."""
        return picture(self._task.batch, 0) if self.render_mode else None

    def close(self) -> None:
        self._task.close()
