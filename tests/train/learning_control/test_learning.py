"""What a few cycles teach."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from kinemimic.retarget.humanoid.body import BODY_NAMES
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.learning_control import LearningControl
from kinemimic.train.learning_control import learning, response
from kinemimic.train.learning_control.corrections import (
    JOINTS,
    Corrections,
    Errors,
    joint,
    measured,
    steps_of_cycle,
)
from kinemimic.train.learning_control.learning import LONG, SHARES, _gains, damped, learn_corrections
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.task.env import ACTIONS, ImitationBatch

QUICK = LearningControl(iterations=5, environments=4, rounds=0)
Humanoids = Callable[[int], ImitationBatch]


def error(batch: ImitationBatch, policy: Policy, corrections: Corrections, name: str) -> float:
    """Root mean square of a joint's flexion over two cycles from the reference on, degrees."""
    found = measured(batch, policy, corrections, 2)
    assert not found.falls.any()
    return float(np.degrees(np.sqrt(found.squares[np.add(JOINTS[name], 3)].mean())))


def test_a_columns_harmonics_are_damped_and_its_mean_is_not() -> None:
    phase = 2.0 * np.pi * np.arange(32) / 32
    columns = np.stack([np.full(32, 0.7), np.sin(2.0 * phase), np.cos(6.0 * phase)], axis=1)
    shares = np.exp(-0.5 * np.square(np.array([0.0, 2.0, 6.0]) / 4.0))
    np.testing.assert_allclose(damped(columns, 4.0), columns * shares, atol=1e-12)


def test_only_knees_and_hips_learn_and_a_hip_less_on_the_ground(batch: ImitationBatch) -> None:
    settings = LearningControl(knee=0.5, hip_swing=0.2, hip_stance=0.1)
    gains = _gains(batch.reference, 38, settings)
    learns = {name for name in BODY_NAMES[1:] if gains[:, joint(name)].any()}
    assert learns == {"thigh_left", "thigh_right", "shin_left", "shin_right"}
    assert np.count_nonzero(gains.any(axis=0)) == 4  # flexion alone
    assert (gains[:, JOINTS["knee"]] == 0.5).all()
    hips = gains[:, JOINTS["hip"]]
    assert set(np.unique(hips)) == {0.1, 0.2}
    # While walking, a foot is on the ground for 60 % of a cycle, and never both swing.
    assert 0.25 < (hips == 0.2).mean() < 0.5
    assert not (hips == 0.2).all(axis=1).any()


def test_the_knees_err_less_after_a_few_cycles(
    humanoids: Humanoids, batch: ImitationBatch, tracker: tuple[Policy, TrainConfig]
) -> None:
    none = Corrections(np.zeros((steps_of_cycle(batch.reference), ACTIONS)))
    before = error(batch, tracker[0], none, "knee")
    told: list[int] = []
    found = learn_corrections(batch, humanoids(1), tracker[0], QUICK, told.append)
    assert found is not None
    assert told == [2 * 4 * 38] * QUICK.iterations + [LONG * 4 * 38]
    assert error(batch, tracker[0], found, "knee") < 0.7 * before


def test_the_identified_response_also_teaches_the_hips(
    humanoids: Humanoids, tracker: tuple[Policy, TrainConfig]
) -> None:
    batch, probe = humanoids(4), humanoids(response.PROBES)
    told: list[int] = []
    found = learn_corrections(batch, probe, tracker[0], replace(QUICK, rounds=2, steps=3), told.append)
    without = learn_corrections(batch, probe, tracker[0], replace(QUICK, iterations=11), lambda _: None)
    assert found is not None
    assert without is not None
    assert told[QUICK.iterations :] == 2 * ([2 * response.PROBES * 38] + [2 * 4 * 38] * 3) + [LONG * 4 * 38]
    hips = [error(batch, tracker[0], corrections, "hip") for corrections in (found, without)]
    assert hips[0] < 0.9 * hips[1]


def test_corrections_with_which_a_humanoid_falls_later_are_reduced(
    batch: ImitationBatch, tracker: tuple[Policy, TrainConfig], monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = replace(QUICK, iterations=2)
    whole = learn_corrections(batch, batch, tracker[0], settings, lambda _: None)
    assert whole is not None
    largest = float(np.abs(whole.table).max())
    tried = set()
    allowed = [0.8]

    def measured_with(*arguments: Any, **options: Any) -> Errors:
        errors = measured(*arguments, **options)
        size = float(np.abs(arguments[2].table).max())
        tried.add(round(size / largest, 3))
        return replace(errors, falls=errors.falls + (arguments[3] == LONG and size > allowed[-1] * largest))

    monkeypatch.setattr(learning, "measured", measured_with)
    for limit, share in ((0.8, SHARES[1]), (0.6, SHARES[2])):
        allowed.append(limit)
        found = learn_corrections(batch, batch, tracker[0], settings, lambda _: None)
        assert found is not None
        np.testing.assert_allclose(found.table, share * whole.table)
    allowed.append(0.1)
    assert learn_corrections(batch, batch, tracker[0], settings, lambda _: None) is None
    assert {1.0, *SHARES} <= tried


def test_it_ends_where_the_caller_ends_it_and_without_a_cycle_without_a_fall(
    batch: ImitationBatch, tracker: tuple[Policy, TrainConfig], monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[int] = []

    def proceed(samples: int) -> None:
        told.append(samples)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        learn_corrections(batch, batch, tracker[0], QUICK, proceed)
    assert len(told) == 1
    monkeypatch.setattr(batch, "fallen", lambda: np.array([True, False, False, False]))
    settings = replace(QUICK, iterations=1, rounds=1)
    assert learn_corrections(batch, batch, tracker[0], settings, lambda _: None) is None
