"""A made-up cyclic motion: a figure that strides on the spot of a known curve, cheap and closed."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.pipeline.rotations import IDENTITY, continuous, from_axis_angle
from kinemimic.pipeline.skeleton import NODE_INDEX, NODES
from kinemimic.retarget.body import STANDING_HEIGHT
from kinemimic.retarget.motion import Motion

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
