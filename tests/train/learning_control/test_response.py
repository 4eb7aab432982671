"""The identified response, on a system that is known: errors that are linear in the corrections."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.pipeline.arrays import Array
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.learning_control import response
from kinemimic.train.learning_control.corrections import JOINTS, TURNS, Corrections, Errors
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.task.env import ACTIONS, ImitationBatch

ROWS = 38
FLEXIONS = np.add(JOINTS["knee"] + JOINTS["hip"], TURNS - ACTIONS)
COLUMNS = JOINTS["knee"] + JOINTS["hip"]


class Linear:
    """In place of `measured`: every correction moves its joint three steps later, and the others a little."""

    def __init__(self, start: Array, fallen: int = 0) -> None:
        self.start, self.fallen = start, fallen
        self.coupling = 0.6 * np.eye(4) + 0.1

    def __call__(
        self, batch: ImitationBatch, policy: Policy, corrections: Corrections, cycles: int, skipped: int = 0
    ) -> Errors:
        tables = corrections.table if corrections.table.ndim == 3 else corrections.table[None]
        count = len(tables)
        sums = np.zeros((count, ROWS, TURNS))
        moved = np.roll(tables[:, :, COLUMNS], 3, axis=1) @ self.coupling
        sums[:, :, FLEXIONS] = self.start - moved
        falls = np.zeros(count, dtype=np.int64)
        falls[: self.fallen] = 1
        sums[: self.fallen] = 1e3  # what they did counts for nothing
        return Errors(sums, np.ones((count, ROWS)), np.zeros(TURNS), falls)


@pytest.fixture
def start() -> Array:
    """Errors (P, 4) of knees and hips with a few harmonics, rad."""
    phase = 2.0 * np.pi * np.arange(ROWS) / ROWS
    random = np.random.default_rng(3)
    waves = [np.cos(k * phase + random.uniform(0.0, 6.0, (4, 1))) for k in range(5)]
    return 0.05 * np.sum(waves, axis=0).T


def test_a_step_along_it_removes_the_errors_of_a_linear_system(
    batch: ImitationBatch, tracker: tuple[Policy, TrainConfig], monkeypatch: pytest.MonkeyPatch, start: Array
) -> None:
    system = Linear(start, fallen=6)
    monkeypatch.setattr(response, "measured", system)
    monkeypatch.setattr(response, "_DAMPING", 1e-9)
    table = np.zeros((ROWS, ACTIONS))
    found = response.identified(batch, tracker[0], table, np.random.default_rng(0))
    assert found is not None
    errors = Linear(start)(batch, tracker[0], Corrections(table), 2)
    change = found.change(errors)
    assert not change[:, [k for k in range(ACTIONS) if k not in COLUMNS]].any()
    after = Linear(start)(batch, tracker[0], Corrections(table + change), 2)
    assert np.abs(after.mean).max() < 1e-4 * np.abs(errors.mean).max()


def test_damping_only_shortens_the_step(
    batch: ImitationBatch, tracker: tuple[Policy, TrainConfig], monkeypatch: pytest.MonkeyPatch, start: Array
) -> None:
    monkeypatch.setattr(response, "measured", Linear(start))
    table = np.zeros((ROWS, ACTIONS))
    errors = Linear(start)(batch, tracker[0], Corrections(table), 2)
    changes = []
    for damping in (1e-9, 1.0, 1e6):
        monkeypatch.setattr(response, "_DAMPING", damping)
        found = response.identified(batch, tracker[0], table, np.random.default_rng(0))
        assert found is not None
        changes.append(found.change(errors))
    lengths = [float(np.linalg.norm(change)) for change in changes]
    assert lengths[0] > lengths[1] > 100.0 * lengths[2]
    assert np.vdot(changes[0], changes[1]) > 0.9 * lengths[0] * lengths[1]


def test_there_is_none_if_too_few_humanoids_stay_upright(
    batch: ImitationBatch, tracker: tuple[Policy, TrainConfig], monkeypatch: pytest.MonkeyPatch, start: Array
) -> None:
    monkeypatch.setattr(response, "measured", Linear(start, fallen=7))
    table = np.zeros((ROWS, ACTIONS))
    assert response.identified(batch, tracker[0], table, np.random.default_rng(0)) is None


def test_the_tables_are_orthogonal_and_of_mean_square_one() -> None:
    tables = response._tables(ROWS).reshape(-1, ROWS * ACTIONS)
    np.testing.assert_allclose(tables @ tables.T / ROWS, np.eye(len(tables)), atol=1e-12)


def test_the_probes_are_orthogonal_to_each_other_and_to_a_constant() -> None:
    signs = response._signs(np.random.default_rng(5))
    assert set(np.unique(signs)) == {-1.0, 1.0}
    assert signs.shape == (response.PROBES, len(response._tables(ROWS)))
    np.testing.assert_array_equal(signs.T @ signs, response.PROBES * np.eye(signs.shape[1]))
    assert not signs.sum(axis=0).any()
