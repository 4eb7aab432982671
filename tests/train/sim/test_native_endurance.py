"""A million control steps of tumbling humanoids: no leaks, no NaN."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.reference.reference import Reference
from kinemimic.train.sim.engines import open_world
from kinemimic.train.task.env import ACTIONS, ImitationBatch

pytest.importorskip("kinemimic_native", reason="the native engine is not built here")

NUM_ENVS = 64
STEPS = 1_000_000 // NUM_ENVS


def resident() -> int:
    """Bytes of memory in use."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


@pytest.mark.slow
def test_a_million_steps(motion: Motion) -> None:
    """A tenth of the humanoids lie on the ground for long; one in a thousand steps explodes one."""
    random = np.random.default_rng(0)
    batch = ImitationBatch(open_world(NUM_ENVS, "native", threads=2), Reference(motion), EnvConfig())
    batch.reset(np.arange(NUM_ENVS), random.random(NUM_ENVS))
    patient = np.arange(NUM_ENVS) < NUM_ENVS // 10
    waited = np.zeros(NUM_ENVS, dtype=np.int64)
    blown, caught, early = 0, 0, 0
    for k in range(STEPS):
        if k == STEPS // 10:
            early = resident()
        actions = random.normal(0, 0.3, (NUM_ENVS, ACTIONS))
        wrenches = None
        if random.random() < 1e-3 * NUM_ENVS:
            wrenches = np.zeros((NUM_ENVS, 15, 6))
            wrenches[random.integers(NUM_ENVS), random.integers(15), :3] = 1e8
            blown += 1
        step = batch.step(actions, wrenches)
        exploded = batch.world.exploded()
        caught += int(exploded.sum())
        assert np.isfinite(step.observations).all()
        assert np.isfinite(step.terms).all()
        assert step.terminated[exploded].all()
        waited = np.where(step.terminated, waited + 1, 0)
        over = step.truncated | exploded | (step.terminated & (~patient | (waited > 60)))
        if over.any():
            rows = np.flatnonzero(over)
            batch.reset(rows, random.random(len(rows)))
    assert blown > 100
    assert caught >= blown
    assert resident() - early < 8e6
