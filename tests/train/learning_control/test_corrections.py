"""Corrections by phase: their table, and what a few cycles teach."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.retarget.humanoid.body import BODY_NAMES
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.learning_control import LearningControl
from kinemimic.train.learning_control.corrections import (
    Corrections,
    _cycles,
    _damped,
    _gains,
    corrected_step,
    joint,
    learn_corrections,
    steps_of_cycle,
)
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.task.env import ACTION_SCALE, ACTIONS, ImitationBatch

QUICK = LearningControl(iterations=4, environments=4)
KNEES = [joint("shin_left"), joint("shin_right")]


def no_corrections(batch: ImitationBatch) -> Corrections:
    return Corrections(np.zeros((steps_of_cycle(batch.reference), ACTIONS)), 0)


def knee_error(batch: ImitationBatch, policy: Policy, corrections: Corrections) -> float:
    """Root mean square over two cycles from the reference on, degrees."""
    batch.reset(np.arange(4), np.arange(4) / 4)
    found = _cycles(batch, policy, corrections, 2 * steps_of_cycle(batch.reference))
    assert found.falls == 0
    return float(np.degrees(np.sqrt(found.square[KNEES].mean())))


def test_a_table_is_linear_between_its_rows_and_goes_on_at_its_end() -> None:
    table = np.zeros((4, ACTIONS))
    knee = KNEES[0]
    table[:, knee] = [1.0, 3.0, 0.0, -1.0]
    found = Corrections(table, 0).at(np.array([0.0, 0.125, 0.25, 0.875, 1.125, -0.75]))
    np.testing.assert_allclose(found[:, knee], [1.0, 2.0, 3.0, 0.0, 2.0, 3.0])
    assert not found[:, [k for k in range(ACTIONS) if k != knee]].any()


def test_a_correction_is_in_units_of_the_action() -> None:
    found = Corrections(np.full((2, ACTIONS), 0.1), 0).at(np.array([0.3]))
    np.testing.assert_allclose(found[0] * ACTION_SCALE, 0.1)


def test_a_columns_harmonics_are_damped_and_its_mean_is_not() -> None:
    phase = 2.0 * np.pi * np.arange(32) / 32
    columns = np.stack([np.full(32, 0.7), np.sin(2.0 * phase), np.cos(6.0 * phase)], axis=1)
    shares = np.exp(-0.5 * np.square(np.array([0.0, 2.0, 6.0]) / 4.0))
    np.testing.assert_allclose(_damped(columns, 4.0), columns * shares, atol=1e-12)


def test_only_knees_and_hips_learn_and_a_hip_less_on_the_ground(batch: ImitationBatch) -> None:
    settings = LearningControl(knee=0.5, hip_swing=0.2, hip_stance=0.1)
    gains = _gains(batch.reference, 38, settings)
    learns = {name for name in BODY_NAMES[1:] if gains[:, joint(name)].any()}
    assert learns == {"thigh_left", "thigh_right", "shin_left", "shin_right"}
    assert np.count_nonzero(gains.any(axis=0)) == 4  # flexion alone
    assert (gains[:, KNEES] == 0.5).all()
    hips = gains[:, [joint("thigh_left"), joint("thigh_right")]]
    assert set(np.unique(hips)) == {0.1, 0.2}
    # While walking, a foot is on the ground for 60 % of a cycle, and never both swing.
    assert 0.25 < (hips == 0.2).mean() < 0.5
    assert not (hips == 0.2).all(axis=1).any()


def test_a_correction_bends_the_joint_that_it_names(
    batch: ImitationBatch, tracker: tuple[Policy, TrainConfig]
) -> None:
    """In either half of the cycle, of which the policy sees one reflected."""
    bent = no_corrections(batch)
    bent.table[:, KNEES[0]] = 0.3
    phases = np.arange(4) / 4
    changes = []
    for corrections in (no_corrections(batch), bent):
        batch.reset(np.arange(4), phases)
        for _ in range(2):
            corrected_step(batch, tracker[0], corrections)
        changes.append(-batch.turns[:, 1:].reshape(4, ACTIONS))
    moved = changes[1] - changes[0]
    assert (moved[:, KNEES[0]] > 0.05).all()
    assert (np.abs(moved[:, KNEES[1]]) < 0.5 * moved[:, KNEES[0]]).all()


def test_the_knees_err_less_after_a_few_cycles(
    batch: ImitationBatch, tracker: tuple[Policy, TrainConfig]
) -> None:
    before = knee_error(batch, tracker[0], no_corrections(batch))
    told: list[int] = []

    def proceed(samples: int) -> bool:
        told.append(samples)
        return True

    found = learn_corrections(batch, tracker[0], QUICK, proceed)
    assert found is not None
    assert len(told) == QUICK.iterations + 1
    assert sum(told) == found.samples
    assert knee_error(batch, tracker[0], found) < 0.7 * before


def test_it_ends_when_told_to_and_without_a_cycle_without_a_fall(
    batch: ImitationBatch, tracker: tuple[Policy, TrainConfig], monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[int] = []
    assert learn_corrections(batch, tracker[0], QUICK, lambda samples: bool(told.append(samples))) is None
    assert len(told) == 1
    monkeypatch.setattr(batch, "fallen", lambda: np.array([True, False, False, False]))
    assert learn_corrections(batch, tracker[0], LearningControl(iterations=1), lambda _: True) is None
