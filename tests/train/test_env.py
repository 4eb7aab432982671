from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from kinemimic.pipeline.rotations import from_axis_angle, multiply, rotate
from kinemimic.retarget.motion import Motion
from kinemimic.train.bullet import BulletWorld
from kinemimic.train.config import EnvConfig
from kinemimic.train.env import ACTIONS, OBSERVATIONS, ImitationBatch
from kinemimic.train.gym_env import ImitationEnv
from kinemimic.train.reference import Reference

pytestmark = pytest.mark.filterwarnings("ignore:.*obs.*:UserWarning")


def turned(motion: Motion, angle: float) -> Motion:
    """The same walk in another direction."""
    q = from_axis_angle("Z", angle)
    rotations = motion.rotations.copy()
    rotations[:, 0] = multiply(q, rotations[:, 0])
    return replace(
        motion, root=rotate(q, motion.root), rotations=rotations, cycle_offset=rotate(q, motion.cycle_offset)
    )


def test_passes_gymnasiums_checker(motion: Motion) -> None:
    env = ImitationEnv(motion)
    check_env(env, skip_render_check=True)
    env.close()


def test_time_up_truncates_and_a_fall_terminates(motion: Motion) -> None:
    env = ImitationEnv(motion, replace(EnvConfig(), episode=3))
    env.reset(seed=0, options={"phase": 0.0})
    ends = [env.step(np.zeros(ACTIONS, dtype=np.float32))[2:4] for _ in range(3)]
    assert ends == [(False, False), (False, False), (False, True)]
    env.close()
    limp = ImitationEnv(motion, EnvConfig())
    limp.reset(seed=0, options={"phase": 0.0})
    for _ in range(100):
        _, reward, terminated, truncated, _ = limp.step(np.full(ACTIONS, 1.5, dtype=np.float32))
        if terminated or truncated:
            break
    assert terminated
    assert not truncated
    assert reward == 0.0
    limp.close()


def test_observation_does_not_depend_on_where_the_walk_leads(motion: Motion) -> None:
    """It is taken in the figure's own heading: turn world and reference together, and nothing changes."""
    found = []
    for angle in (0.0, 2.0):
        batch = ImitationBatch(BulletWorld(2), Reference(turned(motion, angle)), EnvConfig())
        batch.reset(np.arange(2), np.array([0.2, 0.7]))
        found.append(batch.observe())
        batch.world.close()
    assert found[0].shape == (2, OBSERVATIONS)
    np.testing.assert_allclose(found[0], found[1], atol=1e-5)


def test_on_the_reference_nothing_is_left_to_correct(motion: Motion) -> None:
    """Right after a reset the terms are full, the drift zero and the phase as asked."""
    batch = ImitationBatch(BulletWorld(1), Reference(motion), EnvConfig())
    batch.reset(np.array([0]), np.array([0.25]))
    observation = batch.observe()[0]
    assert observation[0] == pytest.approx(1.0)
    assert observation[1] == pytest.approx(0.0, abs=1e-12)
    assert not batch.fallen()[0]
    step = batch.step(np.zeros((1, ACTIONS)))
    assert step.terms.sum() > 0.9
    assert batch.phases[0] == pytest.approx(0.25 + 1 / (30 * motion.duration))
    batch.world.close()
