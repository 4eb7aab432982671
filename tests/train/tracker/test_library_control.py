"""Learning control of many motions: the same law as on one motion, and what it cannot teach."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from peers.trackers import shipped_motion, write_idle_tracker

from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.learning_control import LearningControl
from kinemimic.train.learning_control import corrections, learning
from kinemimic.train.learning_control.corrections import JOINTS, steps_of_cycle
from kinemimic.train.reference.reference import Reference
from kinemimic.train.reference.reference_library import FollowedReference, ReferenceLibrary
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.tracker_file import load_tracker, tracker_path
from kinemimic.train.sim.engines import open_world, resolve
from kinemimic.train.task.env import ACTIONS, ImitationBatch
from kinemimic.train.tracker import library_control
from kinemimic.train.tracker.library_control import HUMANOIDS, ROWS, ControlTask, library_corrections

_COLUMNS = JOINTS["knee"] + JOINTS["hip"]
ENGINE = resolve("auto")


@pytest.fixture(scope="module")
def tables(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The walk that ships, at two speeds."""
    folder, walk = tmp_path_factory.mktemp("tables"), shipped_motion("walk")
    ReferenceLibrary([walk, replace(walk, rate=0.95 * walk.rate)]).save(folder)
    return folder


@pytest.fixture(scope="module")
def tracker() -> tuple[Policy, TrainConfig]:
    policy, record = load_tracker(tracker_path("tracker"))
    return policy, TrainConfig.from_json(record["config"])


def test_gains_and_variances_are_those_of_each_motion_alone(tables: Path) -> None:
    library = ReferenceLibrary.open(tables)
    gains, variances = library_control._gains_and_variances(FollowedReference(library, np.array([0, 1])))
    walk = shipped_motion("walk")
    for k, motion in enumerate((walk, replace(walk, rate=0.95 * walk.rate))):
        reference = Reference(motion)
        alone = learning._gains(reference, ROWS, LearningControl())[:, _COLUMNS]
        # A foot that is just being lifted may count to either side: the tables have different rates.
        assert (gains[k] != alone).mean() < 0.02
        weights = corrections.weights(reference, ROWS)[np.add(_COLUMNS, 3)]
        np.testing.assert_allclose(0.5 / variances[k], np.square(weights), rtol=0.01)


def test_the_mean_error_of_a_phase_is_that_of_the_humanoids(
    tables: Path, tracker: tuple[Policy, TrainConfig]
) -> None:
    """The Fourier series is the table of `corrections.measured`, which counts by rows."""
    policy, config = tracker
    library, motion = ReferenceLibrary.open(tables), shipped_motion("walk")
    rows = steps_of_cycle(motion)
    world = open_world(HUMANOIDS, ENGINE)
    batch = ImitationBatch(
        world, FollowedReference(library, np.zeros(HUMANOIDS, np.intp)), config.measured_env
    )
    found = library_control._measured(batch, policy, np.zeros((1, ROWS, ACTIONS)), 2 * rows)
    batch = ImitationBatch(world, Reference(motion), config.measured_env)
    table = corrections.measured(batch, policy, corrections.Corrections(np.zeros((rows, ACTIONS))), 2)
    world.close()
    series = (
        library_control.design(np.arange(rows) / rows, library_control._HARMONICS) @ found.coefficients[0]
    )
    expected = table.joints[:, _COLUMNS]
    assert found.falls.tolist() == [0]
    # A row counts a few steps only, and not all at its middle.
    assert np.degrees(np.abs(series - expected).mean()) < 0.5
    assert np.degrees(np.abs(expected).mean()) > 1.0
    assert np.corrcoef(series.ravel(), expected.ravel())[0, 1] > 0.97
    np.testing.assert_allclose(found.squares[0], table.squares[np.add(_COLUMNS, 3)], rtol=0.1)


def test_corrections_make_knees_and_hips_err_less(tables: Path, tracker: tuple[Policy, TrainConfig]) -> None:
    policy, config = tracker
    task = ControlTask(tables, np.array([0, 1]), policy, config.measured_env, ENGINE)
    found = library_corrections(task)
    assert found.tables.shape == (2, ROWS, ACTIONS)
    assert found.learned.all()
    assert (found.after < 0.8 * found.before).all()
    corrected = np.flatnonzero(found.tables.any(axis=(0, 1)))
    assert sorted(corrected) == sorted(_COLUMNS)


def test_a_tracker_that_falls_learns_nothing(tables: Path, tmp_path: Path) -> None:
    policy, record = load_tracker(write_idle_tracker(tmp_path) / "policy.safetensors")
    env = TrainConfig.from_json(record["config"]).measured_env
    found = library_corrections(ControlTask(tables, np.array([1, 0]), policy, env, ENGINE))
    assert not found.learned.any()
    assert not found.tables.any()
    assert np.isinf(found.after).all()


def test_where_nobody_is_ever_upright_the_mean_error_is_zero(
    tables: Path, tracker: tuple[Policy, TrainConfig], monkeypatch: pytest.MonkeyPatch
) -> None:
    world, everyone = open_world(HUMANOIDS, ENGINE), np.zeros(HUMANOIDS, np.intp)
    followed = FollowedReference(ReferenceLibrary.open(tables), everyone)
    batch = ImitationBatch(world, followed, tracker[1].measured_env)
    monkeypatch.setattr(batch, "fallen", lambda: np.ones(HUMANOIDS, dtype=np.bool_))
    found = library_control._measured(batch, tracker[0], np.zeros((1, ROWS, ACTIONS)), 3)
    world.close()
    assert found.falls.tolist() == [3 * HUMANOIDS]
    assert not found.coefficients.any()
    assert not found.squares.any()
