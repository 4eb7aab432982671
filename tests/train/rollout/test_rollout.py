"""The loop that all evaluations share: when it stops, what it reports, what it acts on."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.rollout import roll_out
from kinemimic.train.task.env import ACTIONS, ImitationBatch


@pytest.fixture
def batch(motion: Motion, puppets) -> ImitationBatch:
    """Three humanoids without physics: humanoid k falls in step 2 k of its episode, the first one never."""

    class Falling(ImitationBatch):
        def fallen(self) -> np.ndarray:
            return (self.ages == 2 * np.arange(3)) & (np.arange(3) > 0)

    batch = Falling(puppets(3), Reference(motion), EnvConfig())
    batch.reset(np.arange(3), np.zeros(3))
    return batch


def test_a_fall_is_the_first_one_and_the_others_go_on(batch: ImitationBatch) -> None:
    seen = []
    fallen_at = roll_out(batch, None, 6, lambda step, standing: seen.append((step, standing.tolist())))
    assert fallen_at.tolist() == [6, 1, 3]
    assert [step for step, _ in seen] == list(range(6))
    assert [sum(standing) for _, standing in seen] == [3, 2, 2, 1, 1, 1]
    assert batch.world.frozen == [1, 2]


@pytest.mark.parametrize(("until_all_fell", "steps"), [(True, [0, 1, 2]), (False, [0, 1, 2, 3, 4, 5])])
def test_it_stops_before_the_step_in_which_the_last_one_fell(
    batch: ImitationBatch, monkeypatch: pytest.MonkeyPatch, until_all_fell: bool, steps: list[int]
) -> None:
    seen: list[int] = []
    monkeypatch.setattr(batch, "fallen", lambda: batch.ages >= [2, 3, 4])
    fallen_at = roll_out(batch, None, 6, lambda step, _: seen.append(step), until_all_fell=until_all_fell)
    assert seen == steps
    assert fallen_at.tolist() == [1, 2, 3]
    assert batch.world.frozen == ([0, 1] if until_all_fell else [])


def test_it_stops_when_told_and_acts_on_what_a_reset_left(batch: ImitationBatch) -> None:
    observed = []
    wrenches = np.zeros((3, 15, 6))

    def act(observations: np.ndarray) -> np.ndarray:
        observed.append(observations.copy())
        return np.full((3, ACTIONS), 0.5, np.float32)

    def on_step(step: int, _: np.ndarray) -> bool:
        assert batch.wrenches is not None
        assert batch.wrenches.max() == step
        wrenches[:] = step + 1
        if step == 1:
            batch.reset(np.array([0]), np.array([0.25]))
            observed.append(batch.observe())
        return step == 2

    roll_out(batch, act, None, on_step, wrenches=wrenches)
    assert len(observed) == 4
    np.testing.assert_array_equal(observed[2], observed[3])
    assert batch.ages.tolist() == [1, 3, 3]
