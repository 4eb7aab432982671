"""A made-up cyclic motion: a figure that strides on the spot of a known curve, cheap and closed.

And a world without physics, for what is true of any engine.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields

import numpy as np
import pytest

from kinemimic.pipeline.kinematics.rotations import IDENTITY, continuous, from_axis_angle
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES
from kinemimic.retarget.humanoid.body import STANDING_HEIGHT
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import BodyStates, Poses, World

SPEED = 0.9
PERIOD = 1.2


def stride(frames: int = 72) -> Motion:
    turn = 2 * np.pi * np.arange(frames) / frames
    rotations = np.tile(IDENTITY, (frames, len(NODES), 1))
    for side, shift in (("left", 0.0), ("right", np.pi)):
        rotations[:, NODE_INDEX[f"hip_{side}"]] = from_axis_angle("Y", -0.35 * np.sin(turn + shift))
        rotations[:, NODE_INDEX[f"knee_{side}"]] = from_axis_angle("Y", 0.4 + 0.35 * np.cos(turn + shift))
        rotations[:, NODE_INDEX[f"shoulder_{side}"]] = from_axis_angle("Y", 0.2 * np.sin(turn + shift))
    root = np.zeros((frames, 3))
    root[:, 0] = SPEED * PERIOD * np.arange(frames) / frames
    root[:, 2] = STANDING_HEIGHT - 0.03 + 0.01 * np.cos(2 * turn)
    return Motion(
        rate=frames / PERIOD,
        root=root,
        rotations=continuous(rotations),
        contacts=np.zeros((frames, 2), dtype=bool),
        cyclic=True,
        cycle_offset=np.array([SPEED * PERIOD, 0.0, 0.0]),
    )


@pytest.fixture(scope="session")
def motion() -> Motion:
    return stride()


@pytest.fixture(params=["native", "pybullet"])
def engine(request: pytest.FixtureRequest) -> str:
    if request.param == "native":
        pytest.importorskip("kinemimic_native", reason="the native engine is not built here")
    return str(request.param)


class Puppets:
    """A world whose bodies are where `put` puts them; as an engine does, it keeps them in one memory."""

    engine = "puppets"

    def __init__(self, size: int) -> None:
        self.size = size
        self.lost = np.zeros(size, dtype=bool)
        self.frozen: list[int] = []
        self.targets = np.zeros((size, 8, 14, 4))
        self.velocities = np.zeros((size, 8, 14, 3))
        self._states = BodyStates(*(np.zeros((size, 15, k)) for k in (3, 4, 3, 3)))
        self._states.rotations[..., 3] = 1.0

    def put(self, states: BodyStates) -> None:
        for f in fields(BodyStates):
            getattr(self._states, f.name)[:] = getattr(states, f.name)

    def vary(self, indices: np.ndarray, friction: np.ndarray, mass: np.ndarray) -> None:
        pass

    def reset(self, indices: np.ndarray, poses: Poses) -> None:
        self.lost[indices] = False
        self._states.positions[indices] = poses.root[:, None]

    def freeze(self, indices: np.ndarray) -> None:
        self.frozen.extend(indices.tolist())

    def step(self, targets: np.ndarray, velocities: np.ndarray, wrenches: np.ndarray | None) -> BodyStates:
        self.targets, self.velocities = targets, velocities
        self._states.positions[..., 0] += 1.0
        return self._states

    def states(self) -> BodyStates:
        return self._states

    def exploded(self) -> np.ndarray:
        return self.lost.copy()

    def contacts(self) -> np.ndarray:
        return np.zeros((self.size, 2), dtype=bool)

    def contact_forces(self) -> np.ndarray:
        return np.zeros((self.size, 15, 3))

    def peak_torques(self) -> np.ndarray:
        return np.zeros((self.size, 14))

    def close(self) -> None:
        pass


@pytest.fixture
def puppets() -> type[Puppets]:
    return Puppets


@pytest.fixture
def world(engine: str) -> Iterator[World]:
    made = open_world(1, engine, measure_torques=True)
    yield made
    made.close()
