"""Obstacles stand, fly and roll correctly in both engines, and are reset with the humanoid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from peers.stance import HOLD, STEP, upright

from kinemimic.pipeline.gravity import GRAVITY
from kinemimic.pipeline.kinematics.rotations import angle_between, normalize
from kinemimic.retarget.humanoid.body import BODY_INDEX, TOTAL_MASS
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import TIME_STEP, Obstacle, World

BALL = Obstacle("sphere", (0.2, 0.2, 0.2), (0.0, 0.0, 1.8), mass=0.2)
TILTED = (0.1, 0.3, 0.2, 0.86**0.5)
THROWN = Obstacle("box", (0.3, 0.2, 0.1), (1.0, 0.05, 1.2), TILTED, mass=5.0, velocity=(-5.0, 0.0, 1.0))


def test_a_thrown_ball_flies_falls_and_is_reset(world: World) -> None:
    """x = v t, z = h - g t²/2 with the step's own rounding, and the ground stops it."""
    ball = Obstacle("sphere", (0.2, 0.2, 0.2), (2.0, 1.0, 1.5), mass=1.0, velocity=(3.0, 0.0, 0.0))
    world.place(0, [ball])
    for _ in range(2):
        world.reset(np.array([0]), upright(0.905))
        np.testing.assert_allclose(world.obstacles(0)[0, :3], ball.position, atol=1e-12)
        for _ in range(6):
            world.step(*HOLD)
        time = 6 * STEP
        # Semi-implicit Euler falls half a time step's speed further.
        height = 1.5 - 0.5 * GRAVITY * time * (time + TIME_STEP)
        np.testing.assert_allclose(world.obstacles(0)[0, :3], [2.0 + 3.0 * time, 1.0, height], atol=1e-6)
        for _ in range(25):
            world.step(*HOLD)
        assert world.obstacles(0)[0, 2] == pytest.approx(0.1, abs=0.01)


@pytest.mark.parametrize("shape", ["box", "sphere", "cylinder"])
def test_an_obstacle_stops_a_humanoid(world: World, shape: str) -> None:
    """A humanoid that flies at 2 m/s along X does not pass an obstacle a metre wide at x = 1."""
    wall = Obstacle(shape, (1.0, 1.0, 2.0), (1.0, 0.0, 1.6))  # type: ignore[arg-type]
    flying = replace(upright(1.8), root_linear=np.array([[2.0, 0.0, 0.0]]))
    ends = []
    for obstacles in ([], [wall]):
        world.place(0, obstacles)
        world.reset(np.array([0]), flying)
        for _ in range(12):
            state = world.step(*HOLD)
        ends.append(float(state.positions[0, BODY_INDEX["torso"], 0]))
    assert ends[0] == pytest.approx(0.8, abs=0.01)
    assert ends[1] < 0.65


@pytest.mark.parametrize("obstacles", [[], [THROWN]], ids=["ground", "thrown box"])
def test_a_reset_clears_contacts_and_their_forces(
    world: World, engine: str, obstacles: list[Obstacle]
) -> None:
    """A humanoid that stood or was hit before equals a new one to the bit."""

    def live(world: World) -> bytes:
        world.reset(np.array([0]), upright(0.905))
        kept = []
        for _ in range(15):
            state = world.step(*HOLD)
            kept += [state.positions.copy(), state.linear.copy(), world.contact_forces(), world.obstacles(0)]
        return b"".join(values.tobytes() for values in kept)

    world.place(0, obstacles)
    first = live(world)
    assert world.contacts().any()
    world.reset(np.array([0]), upright(5.0))
    assert not world.contacts().any()
    assert not world.contact_forces().any()
    assert live(world) == first
    fresh = open_world(1, engine)
    fresh.place(0, [BALL])
    fresh.place(0, obstacles)
    assert live(fresh) == first
    fresh.close()


def test_an_obstacle_on_the_head_adds_its_weight(world: World) -> None:
    """A ball on the head: the head feels its weight, downwards, and the soles the weight of both."""
    world.place(0, [BALL])
    world.reset(np.array([0]), upright(0.905))
    for _ in range(12):
        world.step(*HOLD)
    forces = world.contact_forces()[0]
    np.testing.assert_allclose(forces[BODY_INDEX["head"]], [0, 0, -BALL.mass * GRAVITY], atol=0.1)
    assert forces.sum(axis=0)[2] == pytest.approx(TOTAL_MASS * GRAVITY, rel=0.02)


def test_an_obstacle_carries_a_humanoid(world: World) -> None:
    world.place(0, [Obstacle("box", (2.0, 2.0, 0.2), (0.0, 0.0, 0.1))])
    world.reset(np.array([0]), upright(1.105))
    for _ in range(12):
        world.step(*HOLD)
    assert world.contacts().all()
    assert world.contact_forces()[0].sum(axis=0)[2] == pytest.approx(TOTAL_MASS * GRAVITY, rel=0.02)


@pytest.mark.parametrize(
    "wrong",
    [{"shape": "cone"}, {"size": (1.0, 0.0, 1.0)}, {"mass": -1.0}, {"position": (np.nan, 0.0, 0.0)}],
    ids=str,
)
def test_an_invalid_obstacle_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="obstacle: expected one of box, sphere, cylinder"):
        replace(BALL, **wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize(("shape", "share"), [("sphere", 5 / 7), ("cylinder", 2 / 3)])
def test_a_sliding_obstacle_starts_to_roll(world: World, shape: str, share: float) -> None:
    """Friction turns speed into spin until v = ω r: v / v₀ = 1 / (1 + I / (m r²)), whatever the friction."""
    lying = (0.5**0.5, 0.0, 0.0, 0.5**0.5)
    slid = Obstacle(shape, (0.2, 0.2, 0.3), (2.0, 0.0, 0.1), lying, 1.0, (2.0, 0.0, 0.0))  # type: ignore[arg-type]
    world.place(0, [slid])
    world.reset(np.array([0]), upright(0.905))
    x = []
    for _ in range(25):
        world.step(*HOLD)
        x.append(world.obstacles(0)[0, 0])
    assert (x[-1] - x[-7]) / (6 * STEP) == pytest.approx(2.0 * share, rel=0.02)


def test_an_obstacle_replaced_in_flight_continues_unchanged(world: World) -> None:
    """A tumbling box that is read and placed again in flight lands in the same place."""
    box = replace(THROWN, position=(1.0, 2.0, 1.5), spin=(3.0, -2.0, 5.0))
    ends = []
    for again in (False, True):
        world.place(0, [box])
        world.reset(np.array([0]), upright(0.905))
        for step in range(8):
            if again and step == 4:
                found = world.obstacles(0)[0].tolist()
                names = {"position": (0, 3), "rotation": (3, 7), "velocity": (7, 10), "spin": (10, 13)}
                held = {name: tuple(found[a:b]) for name, (a, b) in names.items()}
                assert np.linalg.norm(held["spin"]) > 1.0
                world.place(0, [replace(box, **held)])
            world.step(*HOLD)
        ends.append(world.obstacles(0)[0])
    np.testing.assert_allclose(ends[1], ends[0], atol=1e-9)
    assert angle_between(ends[0][3:7], normalize(np.array(box.rotation))) > 0.5
