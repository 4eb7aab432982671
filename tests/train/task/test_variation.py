"""Humanoids with other friction and mass obey mechanics, and nothing else changes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from peers.stance import HOLD, MASSES, STEP, upright

from kinemimic.pipeline.gravity import GRAVITY
from kinemimic.pipeline.kinematics.rotations import from_rotvec
from kinemimic.retarget.humanoid.body import BODIES, BODY_INDEX, FEET, TOTAL_MASS
from kinemimic.train.reference.reference import Reference
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import FRICTION, MIN_MASS, SUBSTEPS, TIME_STEP, BodyStates, World

WEIGHT = TOTAL_MASS * GRAVITY
NORMAL = (FRICTION, 1.0)


def vary(world: World, *kinds: tuple[float, float], first: int = 0) -> None:
    """Friction and mass of the humanoids from `first` on."""
    friction, mass = np.array(kinds).T
    world.vary(np.arange(first, first + len(kinds)), friction, mass)


def start(world: World, height: float, friction: float = FRICTION, mass: float = 1.0) -> None:
    """One upright humanoid with that friction and mass."""
    vary(world, (friction, mass))
    world.reset(np.array([0]), upright(height))


def pushed(share: float, bodies: list[int], component: int) -> np.ndarray:
    """The same force, N, or torque, N·m, on each of some bodies."""
    wrench = np.zeros((1, 15, 6))
    wrench[0, bodies, component] = share
    return wrench


def velocity(state: BodyStates) -> np.ndarray:
    """Velocity of the centre of mass, m/s, independent of a factor for all masses."""
    return np.asarray(MASSES @ state.linear[0] / TOTAL_MASS)


def play(
    world: World, motion: Any, phases: np.ndarray, *, height: float = 0.0, steps: int = 12
) -> np.ndarray:
    """Positions, velocities and forces of humanoids that are reset and then stride."""
    reference, kept = Reference(motion), []
    pose = reference.poses(phases)
    world.reset(np.arange(len(phases)), replace(pose, root=pose.root + np.array([0, 0, height])))
    for k in range(steps):
        at = phases[:, None] + (k * SUBSTEPS + 1 + np.arange(SUBSTEPS)) * TIME_STEP / motion.duration
        state = world.step(*reference.joints(at))
        kept.append(
            np.concatenate([state.positions, state.linear, state.angular, world.contact_forces()], -1)
        )
    return np.array(kept)


@pytest.mark.parametrize("mass", [1.0, 1.6])
def test_a_push_slides_a_humanoid_with_less_friction(world: World, mass: float) -> None:
    """At 0.9 the ground takes up all of the push; at 0.3 the feet slide, and it takes 0.3 of its load."""
    for friction, holds in ((0.9, True), (0.3, False)):
        start(world, 0.905, friction, mass)
        for _ in range(10):
            before = world.step(*HOLD).positions[0, FEET, 0].copy()
        for _ in range(3):
            state = world.step(*HOLD, pushed(0.25 * mass * WEIGHT, FEET, 0))
            x, y, normal = world.contact_forces()[0].sum(axis=0)
            if not holds:
                assert np.hypot(x, y) == pytest.approx(0.3 * normal, rel=0.01)
        moved = state.positions[0, FEET, 0] - before
        if holds:
            assert np.abs(moved).max() < 1e-3
            assert x == pytest.approx(-0.5 * mass * WEIGHT, rel=0.01)
        else:
            assert moved.min() > 0.05


@pytest.mark.parametrize("mass", [0.8, 1.0, 1.7])
def test_a_push_accelerates_inversely_to_the_mass(world: World, mass: float) -> None:
    """100 N for 0.2 s: 20 N·s make 20 / (48.2 m) m/s, and every mass falls alike."""
    start(world, 5.0, mass=mass)
    for _ in range(6):
        state = world.step(*HOLD, pushed(100.0, [BODY_INDEX["torso"]], 1))
    wanted = [0, 20.0 / (mass * TOTAL_MASS), -GRAVITY * 6 * STEP]
    np.testing.assert_allclose(velocity(state), wanted, atol=0.05 / TOTAL_MASS)


@pytest.mark.parametrize("mass", [0.8, 1.0, 1.7])
def test_a_torque_accelerates_inversely_to_the_inertia(world: World, mass: float) -> None:
    """20 N·m about the vertical for 0.1 s: 2 N·m·s, of which two fifths are the bodies' own inertias'."""
    start(world, 5.0, mass=mass)
    for _ in range(3):
        state = world.step(*HOLD, pushed(20.0, [BODY_INDEX["torso"]], 5))
    arm = state.positions[0] - MASSES @ state.positions[0] / TOTAL_MASS
    spin = np.cross(arm, MASSES[:, None] * state.linear[0])[:, 2].sum()
    spin += sum(body.inertia[2] * w for body, w in zip(BODIES, state.angular[0, :, 2], strict=True))
    assert mass * spin == pytest.approx(2.0, rel=0.005)


@pytest.mark.parametrize("mass", [0.8, 1.0, 1.7])
def test_the_ground_carries_what_it_weighs(world: World, mass: float) -> None:
    start(world, 0.905, mass=mass)
    for _ in range(10):
        world.step(*HOLD)
    total = world.contact_forces()[0].sum(axis=0)
    np.testing.assert_allclose(total, [0, 0, mass * WEIGHT], atol=0.02 * mass * WEIGHT)


def test_the_controller_assumes_the_nominal_masses(world: World) -> None:
    """The same targets in the same state give the same torques for any mass."""
    turned = np.broadcast_to(from_rotvec(np.full((14, 3), 0.02)), (1, SUBSTEPS, 14, 4))
    peaks = []
    for mass in (1.0, 0.8, 1.7):
        start(world, 5.0, mass=mass)
        world.step(turned, np.zeros((1, SUBSTEPS, 14, 3)))
        peaks.append(world.peak_torques().copy())
    np.testing.assert_allclose(peaks[1:], np.broadcast_to(peaks[0], (2, 1, 14)), rtol=1e-9)


def test_joints_come_to_rest_at_the_smallest_mass(world: World) -> None:
    """Below MIN_MASS the controller, which assumes more mass, would make the joints oscillate for ever."""
    vary(world, (FRICTION, MIN_MASS))
    swing = np.random.default_rng(0).normal(0, 0.3, (1, 14, 3))
    world.reset(np.array([0]), replace(upright(50.0), joint_velocities=swing))
    for _ in range(30):
        state = world.step(*HOLD)
    assert np.abs(state.angular - state.angular[:, :1]).max() < 1e-3


@pytest.mark.parametrize(("height", "bound"), [(5.0, 1e-6), (0.0, 1e-6)], ids=["air", "ground"])
def test_they_agree_with_pybullet(motion: Any, height: float, bound: float) -> None:
    native = pytest.importorskip("kinemimic_native", reason="the native engine is not built here")
    ends = []
    for engine in ("native", "pybullet"):
        world = open_world(3, engine)
        vary(world, (0.5, 0.75), (1.2, 1.4), (0.2, 1.0))
        kept = play(world, motion, np.array([0.1, 0.6, 0.3]), height=height, steps=7)
        ends.append(kept[-1, ..., :3])
        assert world.contacts().any() == (height == 0.0)
        world.close()
    assert np.abs(ends[0] - ends[1]).max() < (bound if native.double_precision else 1e-3)


def test_restored_defaults_are_the_same_to_the_bit(motion: Any, engine: str) -> None:
    """Never varied, varied to the defaults, or varied and back; neighbours have no influence."""
    phases = np.array([0.1, 0.6])
    world, other = open_world(2, engine), open_world(2, engine)
    never = play(world, motion, phases)
    vary(other, NORMAL, NORMAL)
    same = play(other, motion, phases)
    vary(other, (0.4, 1.3), (1.1, 0.8))
    varied = play(other, motion, phases)
    vary(other, NORMAL)
    half = play(other, motion, phases)
    vary(other, NORMAL, first=1)
    back = play(other, motion, phases)
    world.close()
    other.close()
    assert never.tobytes() == same.tobytes() == back.tobytes()
    assert half[:, 0].tobytes() == never[:, 0].tobytes()
    assert half[:, 1].tobytes() == varied[:, 1].tobytes()
    assert not np.array_equal(varied, never)


def test_a_variation_starts_at_the_reset(world: World) -> None:
    runs = []
    for later in (False, True):
        start(world, 0.905)
        world.step(*HOLD)
        if later:
            vary(world, (0.1, 2.0))
        for _ in range(3):
            state = world.step(*HOLD)
        runs.append(state.positions.tobytes() + world.contact_forces().tobytes())
    assert runs[0] == runs[1]
    world.reset(np.array([0]), upright(0.905))
    for _ in range(10):
        world.step(*HOLD)
    assert world.contact_forces()[0, :, 2].sum() == pytest.approx(2 * WEIGHT, rel=0.02)


def test_invalid_friction_and_mass_are_refused(world: World) -> None:
    for friction, mass, message in (
        (-0.1, 1.0, "friction: expected finite numbers at least 0, found -0.1"),
        (np.nan, 1.0, "friction.*nan"),
        (0.9, np.inf, "mass.*inf"),
        (0.9, 0.6, "mass: expected finite numbers at least 0.7, found 0.6"),
    ):
        with pytest.raises(ValueError, match=message):
            vary(world, (friction, mass))
    with pytest.raises(ValueError, match=r"mass: expected the shape \(1,\), found \(2,\)"):
        world.vary(np.array([0]), np.ones(1), np.ones(2))
    for wrong, error in (([0.0], TypeError), ([1], IndexError), ([2**32], IndexError)):
        with pytest.raises(error):
            world.vary(np.array(wrong), np.ones(1), np.ones(1))
