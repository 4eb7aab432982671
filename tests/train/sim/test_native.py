"""The native engine against analytical mechanics, pybullet and itself."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from peers.stance import STEP, upright

from kinemimic.pipeline.gravity import GRAVITY
from kinemimic.pipeline.kinematics.rotations import conjugate, from_rotvec, multiply, rotate
from kinemimic.retarget.humanoid.body import BODIES, BODY_INDEX
from kinemimic.train.reference.reference import Reference
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import SUBSTEPS, TIME_STEP, Obstacle, Poses

native = pytest.importorskip("kinemimic_native", reason="the native engine is not built here")
from kinemimic.train.sim.native_world import SETTINGS, NativeWorld, description  # noqa: E402 (needs the extension)

RATE = 1.0 / TIME_STEP
ARM = [BODY_INDEX[f"{part}_left"] for part in ("upper_arm", "forearm", "hand")]


def batch(size: int = 1, *, rate: float = RATE, gains: float = 1.0, **changes: Any) -> Any:
    """Humanoids with the project's body; `gains` scales stiffness and damping."""
    body = description()
    body |= {name: gains * body[name] for name in ("stiffness", "damping")}
    settings: dict[str, Any] = {
        **SETTINGS, "threads": 1, "time_step": 1.0 / rate,
    }  # fmt: skip
    return native.Batch(size=size, **{**body, **settings, **changes})


def put(humanoids: Any, joints: np.ndarray, *, spin: Any = (0, 0, 0), velocities: Any = 0.0) -> None:
    """Every humanoid 5 m up, turning at `spin` rad/s, with these joints (14, 4)."""
    size = len(humanoids.positions)
    each = np.ones((size, 1))
    humanoids.reset(
        np.arange(size), each * [0, 0, 5.0], each * [0, 0, 0, 1.0], 0 * each * [1, 1, 1], each * spin,
        np.broadcast_to(joints, (size, 14, 4)), np.broadcast_to(velocities, (size, 14, 3)).astype(float),
    )  # fmt: skip


def hold(humanoids: Any, joints: np.ndarray, seconds: float, rate: float = RATE) -> None:
    """Step with these joints as targets."""
    size, substeps = len(humanoids.positions), round(seconds * rate)
    targets = np.broadcast_to(joints, (size, substeps, 14, 4))
    humanoids.step(targets, np.zeros((size, substeps, 14, 3)))


def posed(seed: int) -> np.ndarray:
    return from_rotvec(np.random.default_rng(seed).normal(0, 0.4, (14, 3)))


def energy_and_spin(humanoids: Any) -> tuple[float, np.ndarray]:
    """Kinetic energy, J, and angular momentum about the centre of mass, N·m·s, of the first humanoid."""
    body = description()
    mass, moments = body["masses"][:, None], body["inertias"]
    center = (mass * humanoids.positions[0]).sum(axis=0) / mass.sum()
    turning = rotate(conjugate(humanoids.rotations[0]), humanoids.angular[0])
    own = rotate(humanoids.rotations[0], moments * turning)
    energy = 0.5 * (mass * humanoids.linear[0] ** 2).sum() + 0.5 * (own * humanoids.angular[0]).sum()
    spin = (np.cross(humanoids.positions[0] - center, mass * humanoids.linear[0]) + own).sum(axis=0)
    return float(energy), spin


def test_falls_freely() -> None:
    """z = h - g t²/2, and half a time step's speed further: semi-implicit Euler."""
    humanoids = batch(gains=0.0)
    put(humanoids, posed(0))
    before = humanoids.positions.copy()
    hold(humanoids, posed(0), 0.5)
    fallen = 0.5 * GRAVITY * 0.5 * (0.5 + TIME_STEP)
    np.testing.assert_allclose(before - humanoids.positions, np.ones((1, 15, 1)) * [0, 0, fallen], atol=1e-6)


def test_a_limp_arm_swings_with_the_period_of_a_pendulum() -> None:
    """Shoulder limp, elbow and wrist stiff, pelvis held: T = 2 π √(I / m g d), at 3° of swing."""
    body = description()
    gains = {name: body[name].copy() for name in ("stiffness", "damping")}
    for values in gains.values():
        values[ARM[0]] = 0.0
    humanoids = batch(rate=1920.0, fixed_root=True, **gains)
    start = np.tile([0.0, 0.0, 0.0, 1.0], (14, 1))
    start[ARM[0] - 1] = from_rotvec(np.array([0.0, np.radians(3.0), 0.0]))
    put(humanoids, start)
    targets = start.copy()
    x = []
    for _ in range(2 * 1920 // 4):
        hold(humanoids, targets, 4 / 1920, 1920.0)
        x.append(humanoids.positions[0, ARM[2], 0])
    swing = np.array(x) - np.mean(x)
    crossings = np.flatnonzero(np.diff(np.sign(swing)) != 0)
    exact = crossings + swing[crossings] / (swing[crossings] - swing[crossings + 1])
    period = 2 * np.diff(exact).mean() * 4 / 1920
    shoulder = humanoids.positions[0, ARM[0]] + rotate(humanoids.rotations[0, ARM[0]], np.array([0, 0, 0.15]))
    arms = humanoids.positions[0, ARM] - shoulder
    masses = body["masses"][ARM]
    inertia = sum(body["inertias"][ARM][:, 1]) + (masses * (arms**2).sum(axis=-1)).sum()
    lever = np.linalg.norm((masses[:, None] * arms).sum(axis=0))
    assert period == pytest.approx(2 * np.pi * np.sqrt(inertia / (GRAVITY * lever)), rel=0.005)


def test_a_rigid_humanoid_conserves_energy_and_angular_momentum() -> None:
    """No gravity, all joints held while it tumbles: within 1 % over 2 s."""
    humanoids = batch(gravity=0.0)
    put(humanoids, posed(1), spin=[0.6, 1.0, 1.6])
    before = energy_and_spin(humanoids)
    hold(humanoids, posed(1), 2.0)
    after = energy_and_spin(humanoids)
    assert after[0] == pytest.approx(before[0], rel=0.01)
    np.testing.assert_allclose(after[1], before[1], atol=0.01 * np.linalg.norm(before[1]))


def test_integration_error_is_first_order_in_the_time_step() -> None:
    """First order: each halving of the step about halves the error after 0.25 s of flailing.

    Gentle flailing, so that no step is divided.
    """
    velocities = np.random.default_rng(2).normal(0, 3.0, (14, 3))
    ends = {}
    for rate in (240.0, 480.0, 960.0, 1920.0, 30720.0):
        humanoids = batch(rate=rate, gains=0.0, gravity=0.0)
        put(humanoids, posed(2), spin=[1.0, 2.0, 0.5], velocities=velocities)
        hold(humanoids, posed(2), 0.25, rate)
        ends[rate] = humanoids.positions.copy()
    truth = ends.pop(30720.0)
    errors = [float(np.abs(end - truth).max()) for end in ends.values()]
    assert all(finer < 0.65 * coarser for coarser, finer in pairwise(errors))


@pytest.mark.parametrize(("height", "bound"), [(5.0, 1e-6), (0.0, 1e-6)], ids=["air", "ground"])
def test_agrees_with_pybullet(motion: Any, height: float, bound: float) -> None:
    """A striding humanoid under stable PD for 0.25 s; single precision may differ by a millimetre."""
    reference, phases = Reference(motion), np.array([0.1, 0.6])
    ends = []
    for engine in ("native", "pybullet"):
        world = open_world(2, engine)
        pose = reference.poses(phases)
        world.reset(np.arange(2), replace(pose, root=pose.root + np.array([0, 0, height])))
        for k in range(round(0.25 * RATE / SUBSTEPS)):
            at = phases[:, None] + (k * SUBSTEPS + 1 + np.arange(SUBSTEPS)) * TIME_STEP / motion.duration
            state = world.step(*reference.joints(at))
        ends.append(state.positions.copy())
        assert world.contacts().any() == (height == 0.0)
        world.close()
    assert np.abs(ends[0] - ends[1]).max() < (bound if native.double_precision else 1e-3)


def test_contacts_of_many_limbs_agree_with_pybullet() -> None:
    """Humanoids that are thrown to the ground, after 0.3 s."""
    random, size = np.random.default_rng(3), 8
    joints, still = np.stack([posed(seed) for seed in range(size)]), np.zeros((size, SUBSTEPS, 14, 3))
    poses = Poses(
        np.tile([0.0, 0.0, 1.3], (size, 1)), from_rotvec(random.normal(0, 1.5, (size, 3))),
        np.tile([0.0, 0.0, -3.0], (size, 1)), random.normal(0, 1.0, (size, 3)), joints, still[:, 0],
    )  # fmt: skip
    ends = []
    for engine in ("native", "pybullet"):
        world = open_world(size, engine)
        world.reset(np.arange(size), poses)
        for _ in range(9):
            state = world.step(np.tile(joints[:, None], (1, SUBSTEPS, 1, 1)), still)
        ends.append((state.positions.copy(), world.contact_forces() / 1e3))
        world.close()
    touching = np.abs(ends[0][1]).any(axis=-1).sum(axis=1)
    assert touching.min() >= 1
    assert touching.max() >= 4
    for ours, theirs in zip(*ends, strict=True):
        assert np.abs(ours - theirs).max() < (1e-4 if native.double_precision else 0.1)


@pytest.mark.parametrize(("friction", "mass"), [(0.9, 1.0), (0.3, 1.3)])
def test_bullets_solver_which_a_near_movable_obstacle_calls_for_agrees_with_ours(
    friction: float, mass: float
) -> None:
    """A mote in the bounding box of an inclined forearm, which it does not touch."""
    joints = np.tile([0.0, 0.0, 0.0, 1.0], (1, 14, 1))
    joints[0, ARM[0] - 1] = from_rotvec(np.array([0.0, -np.pi / 4, 0.0]))
    pose = replace(upright(0.9), joints=joints, root_linear=np.array([[1.0, 0.5, 0.0]]))
    targets = np.tile(joints[:, None], (1, SUBSTEPS, 1, 1))
    world, ends, forces = NativeWorld(1), [], []
    world.vary(np.array([0]), np.array([friction]), np.array([mass]))
    world.reset(np.array([0]), pose)
    forearm, hand = (world.states().positions[0, part] for part in ARM[1:])
    beside = np.cross((hand - forearm) / np.linalg.norm(hand - forearm), [0.0, 1.0, 0.0])
    mote = Obstacle("sphere", (0.01, 0.01, 0.01), tuple(forearm + 0.08 * beside), mass=1e-3)
    for near in ([], [mote]):
        world.place(0, near)
        world.reset(np.array([0]), pose)
        state = world.step(targets, np.zeros((1, SUBSTEPS, 14, 3)))
        ends.append(np.concatenate([state.positions, state.linear, state.angular]))
        forces.append(world.contact_forces()[0])
    assert world.obstacles(0)[0, 7:10] == pytest.approx([0, 0, -GRAVITY * STEP])
    assert np.abs(forces[0]).max() > 30.0
    assert not np.array_equal(*ends), "both were solved in the same way"
    np.testing.assert_allclose(*ends, atol=1e-9 if native.double_precision else 1e-2)
    np.testing.assert_allclose(*forces, atol=1e-6 if native.double_precision else 20.0)


def test_a_humanoid_does_not_depend_on_its_batch_to_the_bit(motion: Any) -> None:
    """One or two threads, alone or in a batch, in any row, new or after an episode and a reset."""
    reference, random = Reference(motion), np.random.default_rng(4)
    corrections = from_rotvec(random.normal(0, 0.1, (25, 1, 1, 14, 3)))
    pushes = random.normal(0, 20.0, (25, 1, 15, 6))

    def live(world: NativeWorld, rows: list[int], phases: list[float]) -> np.ndarray:
        at = np.array(phases)
        world.reset(np.array(rows), reference.poses(at))
        kept = []
        for k, (correction, push) in enumerate(zip(corrections, pushes, strict=True)):
            now = np.full(world.size, at[0])
            now[rows] = at
            times = now[:, None] + (k * SUBSTEPS + 1 + np.arange(SUBSTEPS)) * TIME_STEP / motion.duration
            joints, velocities = reference.joints(times)
            state = world.step(multiply(joints, correction), velocities, np.tile(push, (world.size, 1, 1)))
            found = [getattr(state, name)[rows] for name in ("positions", "rotations", "linear", "angular")]
            kept.append(np.concatenate(found, axis=-1))
        return np.array(kept)

    alone = [live(NativeWorld(1), [0], [phase]) for phase in (0.2, 0.7)]
    pair = live(NativeWorld(2), [0, 1], [0.2, 0.7])
    crowd = NativeWorld(7, threads=2)
    many = live(crowd, [5, 1], [0.2, 0.7])
    again = live(crowd, [1, 5], [0.2, 0.7])
    for found in (pair, many, again):
        assert found[:, 0].tobytes() == alone[0][:, 0].tobytes()
        assert found[:, 1].tobytes() == alone[1][:, 0].tobytes()


def test_invalid_values_are_named() -> None:
    humanoids = batch(2)
    hold(humanoids, posed(0), TIME_STEP)
    with pytest.raises(
        ValueError, match=r"velocities: expected the shape \(2, 8, 14, 3\), found \(2, 1, 14, 3\)"
    ):
        humanoids.step(np.zeros((2, 8, 14, 4)), np.zeros((2, 1, 14, 3)))
    with pytest.raises(ValueError, match="every figure once"):
        row = np.zeros((2, 3))
        humanoids.reset(
            np.array([1, 1]), row, np.ones((2, 4)), row, row, np.ones((2, 14, 4)), np.zeros((2, 14, 3))
        )
    with pytest.raises(IndexError, match="below 2, found 2"):
        humanoids.obstacles(2)
    with pytest.raises(ValueError, match="parents"):
        native.Batch(
            size=1, **{**description(), "parents": np.zeros(15, dtype=np.int32)}, **SETTINGS, threads=1
        )


def test_views_outlive_their_batch() -> None:
    """The arrays are the engine's memory, which lives as long as any of them."""
    humanoids = batch()
    put(humanoids, posed(0))
    positions = humanoids.positions
    copy = positions.copy()
    del humanoids
    assert positions.tobytes() == copy.tobytes()
    assert len(BODIES) == positions.shape[1]


def test_there_are_no_more_threads_than_humanoids() -> None:
    """Even more than the system allows: there would be no humanoids for them."""
    humanoids = batch(2, threads=1_000_000)
    put(humanoids, posed(0))
    hold(humanoids, posed(0), TIME_STEP)
    assert not humanoids.exploded.any()
