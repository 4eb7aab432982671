"""A reference that hurries: by how much, and what it changes in a control step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kinemimic.pipeline.arrays import Array
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.reference.reference import Reference
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import BodyStates
from kinemimic.train.task.env import ACTIONS, ImitationBatch
from kinemimic.train.task.hurry import LARGEST, TOLERATED, hurry


def going(velocities: Array) -> BodyStates:
    """Humanoids (E,) whose bodies all have a velocity (E, 3), m/s."""
    size = len(velocities)
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (size, 15, 1))
    linear = np.repeat(np.asarray(velocities, dtype=float)[:, None], 15, axis=1)
    return BodyStates(np.zeros((size, 15, 3)), rotations, linear, np.zeros((size, 15, 3)))


@pytest.mark.parametrize(
    ("velocity", "expected"),
    [
        ((0.0, 1.0, 0.0), 1.0),  # as wanted
        ((0.0, 1.0 + TOLERATED, 0.5), 1.0),
        ((0.0, 1.3 + TOLERATED, 0.0), 1.3),  # 0.3 m/s too fast
        ((0.2 + TOLERATED, 1.0, 0.0), 1.2),  # aside
        ((-0.2 - TOLERATED, 1.0, 0.0), 1.2),
        ((-0.2, 1.1 + TOLERATED, 0.0), 1.3),  # ahead and aside
        ((0.0, -0.5, 0.0), 1.0),  # pushed back: its next step is not to come sooner
        ((0.2 + TOLERATED, -0.5, 0.0), 1.2),
        ((0.0, 4.0, 0.0), LARGEST),
    ],
)
def test_it_is_as_fast_as_the_push_ahead_and_aside(
    velocity: tuple[float, float, float], expected: float
) -> None:
    """Of a reference that walks along y with 1 m/s."""
    found = hurry(going(np.array([velocity])), going(np.array([[0.0, 1.0, 0.0]])))
    assert found == pytest.approx([expected])


def test_beside_a_reference_that_stands_every_way_is_a_push() -> None:
    turns = np.linspace(0.0, 2.0 * np.pi, 8)
    ways = np.stack([np.cos(turns), np.sin(turns), np.zeros(8)], axis=-1)
    found = hurry(going(0.9 * TOLERATED * ways), going(np.zeros((8, 3))))
    assert (found == 1.0).all()
    assert np.isfinite(hurry(going(2.0 * ways), going(np.zeros((8, 3))))).all()


def test_the_phases_of_a_humanoid_that_is_pushed_run_faster(motion: Motion, engine: str) -> None:
    config = EnvConfig(hurry=True)
    phases = {}
    for name, one in (("hurry", config), ("clock", replace(config, hurry=False))):
        batch = ImitationBatch(open_world(2, engine), Reference(motion), one)
        batch.reset(np.arange(2), np.array([0.2, 0.2]))
        wrenches = np.zeros((2, 15, 6))
        wrenches[1, 0, 0] = 400.0
        for _ in range(8):
            batch.step(np.zeros((2, ACTIONS)), wrenches)
        phases[name] = batch.phases
        batch.world.close()
    step = 1.0 / (30.0 * motion.duration)
    np.testing.assert_allclose(phases["clock"], 0.2 + 8.0 * step)
    np.testing.assert_allclose(phases["hurry"][0], phases["clock"][0])
    assert 0.2 + 9.0 * step < phases["hurry"][1] <= 0.2 + 8.0 * LARGEST * step


@pytest.mark.parametrize("preview", [(1, 4), (4,)])
def test_a_step_is_compared_with_the_pose_that_it_aimed_at(
    motion: Motion, engine: str, preview: tuple[int, ...]
) -> None:
    batch = ImitationBatch(open_world(1, engine), Reference(motion), EnvConfig(hurry=True, preview=preview))
    batch.reset(np.arange(1), np.array([0.2]))
    wrenches = np.zeros((1, 15, 6))
    wrenches[0, 0, 0] = 600.0
    step, hurried = 1.0 / (30.0 * motion.duration), 0
    for _ in range(8):
        before = batch.phases
        batch.step(np.zeros((1, ACTIONS)), wrenches)
        aimed = batch.reference.bodies(before + step)
        np.testing.assert_allclose(batch.target.positions, aimed.positions, atol=1e-9)
        hurried += int(batch.phases[0] > before[0] + 1.1 * step)
    batch.world.close()
    assert hurried


def test_a_reset_of_another_changes_nothing_for_one_that_hurries(motion: Motion, engine: str) -> None:
    batch = ImitationBatch(open_world(2, engine), Reference(motion), EnvConfig(hurry=True))
    batch.reset(np.arange(2), np.array([0.2, 0.2]))
    wrenches = np.zeros((2, 15, 6))
    wrenches[0, 0, 0] = 600.0
    hurried = 0
    for _ in range(8):
        before = batch.phases[0]
        batch.step(np.zeros((2, ACTIONS)), wrenches)
        observed, wanted = batch.observe()[0], batch.target
        hurried += int(batch.phases[0] > before + 1.1 / (30.0 * motion.duration))
        batch.reset(np.array([1]), np.array([0.7]))
        np.testing.assert_array_equal(batch.observe()[0], observed)
        np.testing.assert_array_equal(batch.target.positions[0], wanted.positions[0])
    batch.world.close()
    assert hurried
