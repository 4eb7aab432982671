"""Corrections by phase, and the errors that are measured with them."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.retarget.humanoid.motion import joint_angles
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.learning_control.corrections import (
    JOINTS,
    TURNS,
    Corrections,
    Errors,
    corrected_step,
    joint,
    measured,
    steps_of_cycle,
    weights,
)
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.task.env import ACTION_SCALE, ACTIONS, ImitationBatch

KNEES = JOINTS["knee"]


def no_corrections(batch: ImitationBatch) -> Corrections:
    return Corrections(np.zeros((steps_of_cycle(batch.reference), ACTIONS)))


def test_knees_and_hips_are_found_by_the_names_of_their_bodies() -> None:
    assert JOINTS["knee"] == [joint("shin_left"), joint("shin_right")]
    assert JOINTS["hip"] == [joint("thigh_left"), joint("thigh_right")]


def test_a_table_is_linear_between_its_rows_and_goes_on_at_its_end() -> None:
    table = np.zeros((4, ACTIONS))
    knee = KNEES[0]
    table[:, knee] = [1.0, 3.0, 0.0, -1.0]
    found = Corrections(table).at(np.array([0.0, 0.125, 0.25, 0.875, 1.125, -0.75]))
    np.testing.assert_allclose(found[:, knee], [1.0, 2.0, 3.0, 0.0, 2.0, 3.0])
    assert not found[:, [k for k in range(ACTIONS) if k != knee]].any()


def test_each_environment_may_have_a_table_of_its_own() -> None:
    tables = np.random.default_rng(1).normal(size=(3, 5, ACTIONS))
    phases = np.array([0.1, 0.55, 0.99])
    found = Corrections(tables).at(phases)
    for k, table in enumerate(tables):
        np.testing.assert_array_equal(found[k], Corrections(table).at(phases)[k])


def test_a_correction_is_in_units_of_the_action() -> None:
    found = Corrections(np.full((2, ACTIONS), 0.1)).at(np.array([0.3]))
    np.testing.assert_allclose(found[0] * ACTION_SCALE, 0.1)


def test_a_correction_bends_the_joint_that_it_names(
    batch: ImitationBatch, tracker: tuple[Policy, TrainConfig]
) -> None:
    """In either half of the cycle, of which the policy sees one reflected. The policy has not reacted yet."""
    bent = no_corrections(batch)
    bent.table[:, KNEES[0]] = 0.3
    phases = np.arange(4) / 4
    changes = []
    for corrections in (no_corrections(batch), bent):
        batch.reset(np.arange(4), phases)
        corrected_step(batch, tracker[0], corrections)
        changes.append(-batch.turns[:, 1:].reshape(4, ACTIONS))
    moved = changes[1] - changes[0]
    assert (moved[:, KNEES[0]] > 0.05).all()
    assert (np.abs(moved[:, KNEES[1]]) < 0.5 * moved[:, KNEES[0]]).all()


def test_errors_are_found_at_the_phase_after_the_step(
    batch: ImitationBatch, tracker: tuple[Policy, TrainConfig]
) -> None:
    rows = steps_of_cycle(batch.reference)
    found = measured(batch, tracker[0], no_corrections(batch), 2, skipped=1)
    assert found.sums.shape == (4, rows, TURNS)
    assert found.counts.sum() == 4 * rows
    assert not found.falls.any()
    # The same walk, step by step.
    batch.reset(np.arange(4), np.arange(4) / 4)
    for _ in range(rows + 1):
        corrected_step(batch, tracker[0], no_corrections(batch))
    row = round(float(np.mod(batch.phases[2], 1.0)) * rows) % rows
    np.testing.assert_allclose(found.sums[2, row], batch.turns[2].ravel(), atol=1e-9)


def test_who_falls_is_counted_and_its_errors_are_not(
    batch: ImitationBatch, tracker: tuple[Policy, TrainConfig], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(batch, "fallen", lambda: np.array([True, False, False, False]))
    rows = steps_of_cycle(batch.reference)
    found = measured(batch, tracker[0], no_corrections(batch), 1)
    np.testing.assert_array_equal(found.falls, [rows, 0, 0, 0])
    np.testing.assert_array_equal(found.counts.sum(axis=1), [0, rows, rows, rows])
    assert not found.by_humanoid[0].any()


def test_means_weigh_every_control_step_alike() -> None:
    sums, counts = np.zeros((2, 1, TURNS)), np.array([[3.0], [1.0]])
    sums[:, 0, 5] = [0.6, 0.6]
    errors = Errors(sums, counts, np.zeros(TURNS), np.zeros(2, dtype=np.int64))
    assert errors.by_humanoid[:, 0, 5].tolist() == pytest.approx([0.2, 0.6])
    assert errors.mean[0, 5] == pytest.approx(0.3)
    assert errors.joints[0, 2] == errors.mean[0, 5]


def test_what_remains_is_what_the_coefficients_of_determination_leave_out(batch: ImitationBatch) -> None:
    rows = 38
    curves = joint_angles(batch.reference.nodes(np.arange(rows) / rows))
    squares = np.full(TURNS, 7.0)  # of joints that do not count
    expected = 0.0
    for name, error in (("knee", 0.05), ("hip", 0.03)):
        squares[np.add(JOINTS[name], 3)] = error**2
        expected += error**2 / np.mean([curves[f"{name}_{side}"].var() for side in ("left", "right")])
    errors = Errors(np.zeros((1, rows, TURNS)), np.ones((1, rows)), squares, np.zeros(1, dtype=np.int64))
    assert errors.remaining(weights(batch.reference, rows)) == pytest.approx(expected)
    assert errors.remaining(weights(batch.reference, rows, others=0.1)) > expected
