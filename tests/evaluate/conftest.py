"""Synthetic walks with known values, legs that swing as sinusoids; rollouts of them; batches in process."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from peers.compared import write_comparison
from peers.crouch import crouching

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import IDENTITY, from_axis_angle
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES
from kinemimic.pipeline.parallel import executor
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.rollout.trajectory import Trajectory
from kinemimic.train.sim.world import CONTROL_RATE

# The speed at which the feet of these legs do not slide.
PERIOD, SPEED, HEIGHT = 1.2, 0.41, 0.9
KNEE, HIP = (0.5, 0.4), (0.1, 0.35)  # mean and amplitude, rad


def angle(name: str, phase: Array) -> Array:
    """The knee's or hip's curve in radians at phases in cycles."""
    mean, amplitude = KNEE if name.startswith("knee") else HIP
    return mean + amplitude * np.sin(2 * np.pi * (phase + (0.5 if name.endswith("right") else 0.0)))


def legs(phase: Array, offset: float = 0.0) -> Array:
    """Local rotations (..., 20, 4); offset: radians that every knee is bent further."""
    rotations = np.broadcast_to(IDENTITY, (*phase.shape, len(NODES), 4)).copy()
    for side in ("left", "right"):
        knee, hip = angle(f"knee_{side}", phase) + offset, angle(f"hip_{side}", phase)
        rotations[..., NODE_INDEX[f"knee_{side}"], :] = from_axis_angle("Y", knee)
        rotations[..., NODE_INDEX[f"hip_{side}"], :] = from_axis_angle("Y", -hip)
    return rotations


def path(phase: Array) -> Array:
    root = np.zeros((*phase.shape, 3))
    root[..., 0], root[..., 2] = SPEED * PERIOD * phase, HEIGHT
    return root


@pytest.fixture
def inline(monkeypatch: pytest.MonkeyPatch) -> None:
    """Captures of a batch in this process, which spares the start of others."""
    monkeypatch.setattr(executor, "isolated_map", lambda work, tasks, **_: enumerate(map(work, tasks)))


@pytest.fixture(scope="session")
def walk() -> Motion:
    """One cycle, simulated capture."""
    phase = np.arange(36) / 36
    return Motion(
        rate=36 / PERIOD,
        root=path(phase),
        rotations=legs(phase),
        contacts=np.zeros((36, 2), dtype=bool),
        cyclic=True,
        cycle_offset=np.array([SPEED * PERIOD, 0.0, 0.0]),
        provenance={"simulated": True, "capture": {"source": "made <up>.bvh"}},
    )


@pytest.fixture(scope="session")
def curve() -> Callable[[str, Array], Array]:
    return angle


@pytest.fixture(scope="session")
def performance() -> Callable[..., Trajectory]:
    """Rollouts from `rollouts` phases; `offset` bends the knees (rad), from frame `fall` on nothing moves."""

    def make(
        rollouts: int = 3, frames: int = 600, *, offset: float = 0.0, fall: int | None = None
    ) -> Trajectory:
        start = np.arange(rollouts) / rollouts
        phases = start[:, None] + (np.arange(frames) + 1) / CONTROL_RATE / PERIOD
        played = Trajectory(
            start_phases=start,
            phases=phases,
            root=path(phases),
            rotations=legs(phases, offset),
            reference_root=path(phases),
            reference_rotations=legs(phases),
            rewards=np.broadcast_to([0.5, 0.25], (rollouts, frames, 2)).copy(),
            reward_names=np.array(["pose", "height"]),
            fallen_at=np.full(rollouts, frames),
            torques=np.full((rollouts, frames, 14), 5.0),
            contacts=np.zeros((rollouts, frames, 2), dtype=bool),
            contact_forces=np.zeros((rollouts, frames, 15, 3)),
        )
        if fall is None:
            return played
        root, rotations = played.root.copy(), played.rotations.copy()
        root[:, fall:], rotations[:, fall:] = root[:, fall : fall + 1], rotations[:, fall : fall + 1]
        root[:, fall:, 2] = 0.1
        return replace(played, root=root, rotations=rotations, fallen_at=np.full(rollouts, fall))

    return make


@pytest.fixture
def compared(tmp_path: Path, walk: Motion) -> Callable[..., Path]:
    """Makes folders as written by `compare`, of a crouching humanoid with almost idle policies."""

    def make(
        name: str = "compared",
        *,
        returns: Sequence[float] = (0.5,),
        variants: Sequence[str] = ("default", "ddpg", "a2c", "sb3-ppo"),
        on: Sequence[str] = ("walk", "run", "walk@several-obstacles"),
    ) -> Path:
        motions = {"walk": crouching(walk), "run": replace(crouching(walk), rate=40.0)}
        return write_comparison(tmp_path / name, motions, returns=returns, variants=variants, on=on)

    return make
