"""What a policy endures: a share of the reward, the same whoever is asked with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from peers.constant import constant
from peers.inline_workers import InlineWorkers

from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.env_config import DomainRandomization, EnvConfig
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout import robustness as ordeal
from kinemimic.train.rollout.robustness import ROBUSTNESS_EPISODES, RobustnessEvaluation
from kinemimic.train.sim.world import CONTROL_RATE
from kinemimic.train.task.domain_randomization import RandomizationSample, draw

STILL = constant()
HARD = EnvConfig(
    episode=40,
    domain_randomization=DomainRandomization(push=(50.0, 200.0), rest=(0.1, 0.4), mass=(0.8, 1.2), tilt=0.05),
)
REWARD = HARD.reward


def test_it_is_the_share_of_the_reward_until_the_fall(
    motion: Motion, puppets, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two figures that are always where their reference is; one explodes after ten steps of forty."""
    reference = Reference(motion)
    begins = np.array([0, 5]) / ROBUSTNESS_EPISODES

    class Perfect(puppets):
        steps = 0

        def step(self, *arguments):
            self.steps += 1
            self.lost[1] = self.steps > 10
            self.put(reference.bodies(begins + self.steps / (CONTROL_RATE * reference.duration)))
            return self.states()

    monkeypatch.setattr(ordeal, "open_world", lambda size, engine: Perfect(size))
    double = replace(REWARD, weights={name: 2.0 * weight for name, weight in REWARD.weights.items()})
    found = RobustnessEvaluation(reference, HARD, [0, 5], "puppets").robust_returns(STILL, double)
    assert found == pytest.approx([1.0, 0.25], abs=1e-6)


@pytest.mark.parametrize(("episode", "frames"), [(10, 20), (400, 20)])
def test_a_motion_that_is_performed_once_is_judged_by_the_whole_of_it(
    motion: Motion, puppets, monkeypatch: pytest.MonkeyPatch, episode: int, frames: int
) -> None:
    once = Reference(replace(motion, cyclic=False, rate=(len(motion.root) - 1) * CONTROL_RATE / frames))
    lengths = []
    monkeypatch.setattr(ordeal, "open_world", lambda size, engine: puppets(size))
    monkeypatch.setattr(ordeal, "roll_out", lambda batch, act, steps, record: lengths.append(steps))
    config = replace(HARD, episode=episode)
    RobustnessEvaluation(once, config, [0], "puppets").robust_returns(STILL, REWARD)
    RobustnessEvaluation(Reference(motion), config, [0], "puppets").robust_returns(STILL, REWARD)
    assert lengths == [frames, episode]


def test_each_figure_has_hardships_of_its_own_and_they_stay_the_same(motion: Motion, engine: str) -> None:
    hard = RobustnessEvaluation(Reference(motion), HARD, range(ROBUSTNESS_EPISODES), engine)
    found = hard.robust_returns(STILL, REWARD)
    assert len(set(found)) == ROBUSTNESS_EPISODES
    calm = RobustnessEvaluation(
        Reference(motion),
        replace(HARD, domain_randomization=DomainRandomization()),
        range(ROBUSTNESS_EPISODES),
        engine,
    )
    assert all(one != other for one, other in zip(calm.robust_returns(STILL, REWARD), found, strict=True))
    assert hard.robust_returns(STILL, REWARD) == found


def test_they_are_drawn_in_full(motion: Motion, puppets, monkeypatch: pytest.MonkeyPatch) -> None:
    given = []

    def noted(
        domain_randomization: DomainRandomization, strength: float, random: np.random.Generator
    ) -> RandomizationSample:
        given.append((domain_randomization, strength))
        return draw(domain_randomization, strength, random)

    monkeypatch.setattr(ordeal, "draw", noted)
    monkeypatch.setattr(ordeal, "open_world", lambda size, engine: puppets(size))
    RobustnessEvaluation(Reference(motion), HARD, range(3), "puppets")
    assert given == [(HARD.domain_randomization, 1.0)] * 3


def test_it_does_not_matter_how_many_processes_share_the_figures(motion: Motion, engine: str) -> None:
    alone, many = (
        InlineWorkers(motion, HARD, 20, 0, count, engine).robust_returns(STILL, REWARD) for count in (1, 20)
    )
    assert len(alone) == ROBUSTNESS_EPISODES
    np.testing.assert_array_equal(many, alone)
