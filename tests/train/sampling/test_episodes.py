from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from peers.trackers import CONFIG, shipped_motion

from kinemimic.train.config.env_config import DomainRandomization
from kinemimic.train.reference.reference import Reference
from kinemimic.train.sampling.episodes import begin_episodes
from kinemimic.train.scenario.clutter import CLUTTER
from kinemimic.train.sim.engines import open_world
from kinemimic.train.task.env import ImitationBatch

OBSTACLES = len(CLUTTER.obstacles)
ENV = replace(CONFIG.env, domain_randomization=DomainRandomization(displacement=0.2))


def test_some_episodes_begin_among_obstacles() -> None:
    """Those that the draw says, each with its own; a snapshot has them too."""
    env = replace(CONFIG.env, domain_randomization=DomainRandomization(obstacles=0.5))
    batch = ImitationBatch(open_world(16, "pybullet"), Reference(shipped_motion("walk")), env)
    randoms = [np.random.default_rng(seed) for seed in range(16)]
    begin_episodes(batch, np.arange(16), randoms, 1.0)
    counts = np.array([len(batch.world.placed(k)) for k in range(16)])
    assert set(counts) == {0, OBSTACLES}
    assert 3 <= (counts == OBSTACLES).sum() <= 13
    first = {batch.world.placed(k)[0].position for k in range(16) if counts[k]}
    assert len(first) == (counts == OBSTACLES).sum()
    # They are not those of a scenario, beside which nothing may be thrown.
    assert batch.scheduled_obstacles(int(counts.argmax())) is None
    snapshot = batch.snapshot()
    begin_episodes(batch, np.arange(16), randoms, 0.0)
    assert not any(len(batch.world.placed(k)) for k in range(16))
    batch.restore(snapshot)
    np.testing.assert_allclose(batch.snapshot()["obstacles"], snapshot["obstacles"], atol=1e-12)
    assert [len(batch.world.placed(k)) for k in range(16)] == counts.tolist()
    batch.world.close()


def test_only_the_displaced_start_beside_their_reference() -> None:
    batch = ImitationBatch(open_world(4, "pybullet"), Reference(shipped_motion("walk")), ENV)
    randoms = [np.random.default_rng(seed) for seed in range(4)]
    displaced = np.array([True, False, True, False])
    begin_episodes(batch, np.arange(4), randoms, 1.0, np.full(4, 0.3), displaced=displaced)
    beside = np.linalg.norm((batch.bodies.positions - batch.target.positions)[:, 0], axis=-1)
    assert (beside[displaced] > 0.01).all()
    assert beside[~displaced] == pytest.approx(0.0, abs=1e-3)
    begin_episodes(batch, np.arange(4), randoms, 1.0, np.full(4, 0.3))
    beside = np.linalg.norm((batch.bodies.positions - batch.target.positions)[:, 0], axis=-1)
    assert (beside > 0.01).all()
    batch.world.close()
