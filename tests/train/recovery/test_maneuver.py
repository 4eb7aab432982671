"""Maneuvers: knots of a few joints, linear in between, nothing before and after."""

from __future__ import annotations

import numpy as np

from kinemimic.retarget.humanoid.body import BODIES
from kinemimic.train.recovery.maneuver import COLUMNS, EVERY, KNOTS, STEPS, actions
from kinemimic.train.task.env import ACTION_SCALE, ACTIONS


def test_trunk_and_legs_take_part() -> None:
    assert len(set(COLUMNS)) == len(COLUMNS)
    moved = {BODIES[1 + column // 3].name for column in COLUMNS}
    assert moved == {
        "torso",
        *(f"{part}_{side}" for part in ("thigh", "shin", "foot") for side in ("left", "right")),
    }


def test_knots_are_reached_and_joined_by_lines() -> None:
    knots = np.random.default_rng(0).normal(size=(3, KNOTS, len(COLUMNS)))
    turns = actions(knots) * ACTION_SCALE
    assert turns.shape == (STEPS, 3, ACTIONS)
    assert not turns[0].any()
    for k in range(KNOTS):
        np.testing.assert_allclose(turns[EVERY * (k + 1)][:, COLUMNS], knots[:, k])
    between = 0.25 * knots[:, 3] + 0.75 * knots[:, 4]
    np.testing.assert_allclose(turns[4 * EVERY + 3][:, COLUMNS], between)
    np.testing.assert_allclose(turns[-1][:, COLUMNS], knots[:, -1] / EVERY)  # on its way to nothing
    others = np.setdiff1d(np.arange(ACTIONS), COLUMNS)
    assert not turns[..., others].any()
