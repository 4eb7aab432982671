from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kinemimic.pipeline.kinematics.rotations import IDENTITY, from_axis_angle
from kinemimic.retarget.humanoid.body import node_offsets
from kinemimic.retarget.humanoid.motion import Motion

MOTION = Motion(
    rate=60.0,
    root=np.zeros((4, 3)),
    rotations=np.tile(IDENTITY, (4, 20, 1)),
    contacts=np.ones((4, 2), dtype=np.bool_),
    cyclic=True,
    cycle_offset=np.array([1.2, 0.0, 0.0]),
)


@pytest.mark.parametrize(
    "change",
    [
        {"rate": 59.0},
        {"root": np.full((4, 3), 0.1)},
        {"rotations": np.tile(from_axis_angle("Y", 0.1), (4, 20, 1))},
        {"offsets": 1.1 * node_offsets()},
        {"cyclic": False},
        {"cycle_offset": np.array([1.3, 0.0, 0.0])},
    ],
    ids=lambda change: next(iter(change)),
)
def test_everything_that_a_policy_is_trained_on_decides_the_identity(change):
    assert replace(MOTION, **change).identity != MOTION.identity


def test_contacts_and_provenance_do_not_change_the_identity():
    other = replace(MOTION, contacts=~MOTION.contacts, provenance={"made": "elsewhere"})
    assert other.identity == MOTION.identity
