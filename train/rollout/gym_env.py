"""The task as a Gymnasium environment with one humanoid."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import EnvConfig
from kinemimic.train.rollout.sampler import start_phase
from kinemimic.train.scenario.route import reference_for
from kinemimic.train.sim.engines import open_world
from kinemimic.train.task.domain_randomization import draw
from kinemimic.train.task.env import ACTIONS, ImitationBatch, observation_size

Observation = NDArray[np.float32]

# rad: actions correct the reference pose, and no human joint needs a larger correction.
ACTION_BOUND = 2.0


class ImitationEnv(gym.Env[Observation, NDArray[np.float32]]):
    """Imitate `motion` with one humanoid.

    Observations and actions (42,) are those of `ImitationBatch`: mirrored in the second half of a gait cycle,
    unless the configuration turns `mirror` off. A fall terminates an episode; the end of its time truncates
    it. Each episode draws the configuration's domain randomization at full strength and starts at a random
    phase, at 0 without `start_anywhere`, or at p after `reset(options={"phase": p})`. `info` holds the
    reward's terms. engine: see `sim/engines.py`.
    """

    metadata = {"render_modes": []}  # noqa: RUF012 (Gymnasium's own form)

    def __init__(self, motion: Motion, config: EnvConfig | None = None, engine: str = "auto") -> None:
        self._config = config or EnvConfig()
        self._batch = ImitationBatch(
            open_world(1, engine), reference_for(motion, self._config.scenario), self._config
        )
        size = observation_size(self._config)
        self.observation_space = gym.spaces.Box(-np.inf, np.inf, (size,), np.float32)
        self.action_space = gym.spaces.Box(-ACTION_BOUND, ACTION_BOUND, (ACTIONS,), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        super().reset(seed=seed)
        config, random = self._config, self.np_random
        phase = (options or {}).get("phase")
        if phase is None:
            phase = start_phase(config, random)
        conditions = draw(config.domain_randomization, 1.0, random)
        seeds = None
        if config.scenario is not None:
            seeds = np.array([random.integers(1 << 63)], dtype=np.uint64)
        self._batch.reset(np.array([0]), np.array([float(phase)]), conditions, seeds)
        return self._batch.observe()[0].astype(np.float32), {}

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        step = self._batch.step(np.asarray(action, dtype=np.float64)[None])
        terms = dict(zip(self._config.reward.weights, step.terms[0].tolist(), strict=True))
        return (
            step.observations[0].astype(np.float32),
            float(step.terms.sum()),
            bool(step.terminated[0]),
            bool(step.truncated[0]),
            {"terms": terms},
        )

    def close(self) -> None:
        self._batch.world.close()
