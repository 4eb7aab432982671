"""The imitation task with Gymnasium's spaces: actions in [-1, 1], bounded observations, both in float32."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from kinemimic.evaluate.policies.shipped import ShippedPolicies
from kinemimic.pipeline.arrays import Array, Floats
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.retarget.formats.motion_json import MOTION, read_motion_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.sampling.episodes import begin_episodes
from kinemimic.train.scenario.route import reference_for
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import MAX_SPEED
from kinemimic.train.task.env import ACTIONS, ImitationBatch
from kinemimic.train.task.observation_layout import layout
from kinemimic.train.task.obstacle_observation import FARTHEST, FASTEST, LARGEST, REACH, UNIT

# The action of `ImitationBatch` at 1. The shipped policies' largest is 0.45.
ACTION_LIMIT = 0.5
RENDER_MODES = ("rgb_array",)
# Largest absolute values of the parts of an observation, in their units (`observation_layout.py`). The height
# and the angular velocity of a humanoid that walks are a tenth of theirs; the others cannot be larger.
_BOUNDS = {
    "phase": 1.0,
    "height": 10.0,
    "rotations": 1.0,
    "positions": 3.0,
    "linear": MAX_SPEED,
    "angular": 1000.0,
    "turns": np.pi,
    "way": 1.0,
    # Clipped in the world, then turned; differences of two velocities.
    "way_to_reference": np.sqrt(2.0),
    "linear_to_reference": 2.0 * MAX_SPEED,
    "angular_to_reference": 2000.0,
    "obstacle": max(FARTHEST, FASTEST, LARGEST),
    "legs_to_obstacles": REACH / UNIT,
}


def load_motion(motion: Motion | str | Path) -> Motion:
    """A motion, or that of a motion.json, of a run folder or of a shipped policy; KinemimicError if there is
    none."""
    if isinstance(motion, Motion):
        return motion
    path = Path(motion)
    if path.exists():
        return read_motion_json(path / MOTION if path.is_dir() else path)
    shipped = ShippedPolicies()
    names = [name for name in shipped.names() if (shipped.folder / name / MOTION).is_file()]
    if str(motion) not in names:
        raise KinemimicError(
            f"motion: expected a motion.json, a run folder or a shipped policy ({', '.join(names)}), found "
            f"{str(motion)!r}"
        )
    return read_motion_json(shipped.folder / str(motion) / MOTION)


def checked_render_mode(mode: str | None) -> str | None:
    """The render mode; KinemimicError if there is no such mode."""
    if mode is not None and mode not in RENDER_MODES:
        raise KinemimicError(f"render_mode: expected {', '.join(RENDER_MODES)} or none, found {mode!r}")
    return mode


def spaces(config: EnvConfig) -> tuple[Box[np.float32], Box[np.float32]]:
    """Spaces of one environment's observations (O,) and actions (42,)."""
    parts = layout(config)
    names = [part["name"] for part in parts]
    bounds = [_BOUNDS[name if name in _BOUNDS else name.partition("_")[0]] for name in names]
    high = np.repeat(bounds, [part["size"] for part in parts]).astype(np.float32)
    return Box(-high, high, dtype=np.float32), Box(-1.0, 1.0, (ACTIONS,), np.float32)


@dataclass(frozen=True)
class Transition:
    """A control step of E environments.

    observations: (E, O) after it, before a reset; rewards: (E,); terms: (E, K) of the reward, in the order of
    `ImitationTask.term_names`; terminated: (E,) fell or left the reference; truncated: (E,) the time is over.
    """

    observations: Floats
    rewards: Array
    terms: Array
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]


class ImitationTask:
    """E environments on one batch; `observation_space` and `action_space` are those of a single one."""

    def __init__(self, size: int, motion: Motion, config: EnvConfig, engine: str, threads: int = 1) -> None:
        world = open_world(size, engine, threads=threads)
        self.batch = ImitationBatch(world, reference_for(motion, config.scenario), config)
        self.term_names = tuple(config.reward.weights)
        self.observation_space, self.action_space = spaces(config)

    def begin(
        self,
        indices: NDArray[np.intp],
        randoms: Sequence[np.random.Generator],
        options: dict[str, Any] | None = None,
    ) -> None:
        """Begin episodes in environments (N,), each drawn from its own generator.

        options: `phase`, at which they begin, a number or one for each of the N. KinemimicError for others.
        """
        options = options or {}
        if unknown := options.keys() - {"phase"}:
            raise KinemimicError(f"options: expected phase, found {', '.join(map(repr, sorted(unknown)))}")
        phases = options.get("phase")
        if phases is not None:
            phases = np.array(phases, dtype=np.float64)
            if phases.shape not in {(), (len(indices),)} or not np.isfinite(phases).all():
                found = f"{options['phase']!r}"
                raise KinemimicError(
                    f"options: expected a finite phase, or one for each of {len(indices)}, found {found}"
                )
            phases = np.broadcast_to(phases, len(indices))
        begin_episodes(self.batch, indices, randoms, 1.0, phases)

    def observe(self) -> Floats:
        """Observations (E, O) within their space."""
        return self._bounded(self.batch.observe())

    def step(self, actions: NDArray[Any]) -> Transition:
        """Step with actions (E, 42), which are clipped to [-1, 1]; KinemimicError for others."""
        size = self.batch.world.size
        actions = np.asarray(actions, dtype=np.float64)
        if actions.shape != (size, ACTIONS) or not np.isfinite(actions).all():
            found = "not finite" if actions.shape == (size, ACTIONS) else f"of shape {actions.shape}"
            raise KinemimicError(
                f"actions: expected finite numbers of shape {(size, ACTIONS)}, found them {found}"
            )
        step = self.batch.step(ACTION_LIMIT * np.clip(actions, -1.0, 1.0))
        return Transition(
            self._bounded(step.observations),
            step.terms.sum(axis=1),
            step.terms,
            step.terminated,
            step.truncated,
        )

    def _bounded(self, observations: Array) -> Floats:
        return np.clip(
            observations.astype(np.float32), self.observation_space.low, self.observation_space.high
        )

    def close(self) -> None:
        """Free the engine's memory."""
        self.batch.world.close()
