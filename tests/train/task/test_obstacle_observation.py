"""What a policy observes of obstacles: known places, distances, and the symmetries of the rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kinemimic.pipeline.kinematics.rotations import (
    IDENTITY,
    from_axis_angle,
    multiply,
    normalize,
    rotate,
)
from kinemimic.retarget.humanoid.body import BODY_INDEX
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.env_config import EnvConfig, Tracking
from kinemimic.train.reference.reference import Reference
from kinemimic.train.scenario.overlap import distance
from kinemimic.train.scenario.scenario_file import find_scenario
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import BodyStates, Obstacle, World
from kinemimic.train.task.env import ImitationBatch
from kinemimic.train.task.mirror import COUNTERPARTS, QUATERNION, VECTOR
from kinemimic.train.task.obstacle_observation import (
    LEGS_SIZE,
    OBSTACLE_SIZE,
    ObstacleStates,
    _outer,
    observe_obstacles,
    obstacle_reflection,
    obstacle_states,
)

COUNT = 3
BOX, SPHERE, CYLINDER = 0, 1, 2


def bodies(size: int, seed: int = 0) -> BodyStates:
    """Humanoids whose bodies are anywhere within about half a metre of their pelvis."""
    random = np.random.default_rng(seed)
    turns = normalize(random.normal(size=(size, 15, 4)))
    still = np.zeros((size, 15, 3))
    return BodyStates(random.normal(0.0, 0.3, (size, 15, 3)), turns, still, still)


def scattered(size: int, seed: int = 1) -> ObstacleStates:
    """Two of each shape around each humanoid, turned and moving in any direction."""
    random = np.random.default_rng(seed)
    shapes = np.tile([BOX, SPHERE, CYLINDER] * 2, (size, 1))
    return ObstacleStates(
        there=np.ones((size, 6), dtype=bool),
        shapes=shapes,
        positions=random.normal(0.0, 0.7, (size, 6, 3)),
        rotations=normalize(random.normal(size=(size, 6, 4))),
        linear=random.normal(0.0, 1.0, (size, 6, 3)),
        sizes=random.uniform(0.1, 0.5, (size, 6, 3)),
    )


def one(obstacle: Obstacle) -> ObstacleStates:
    shape = {"box": BOX, "sphere": SPHERE, "cylinder": CYLINDER}[obstacle.shape]
    return ObstacleStates(
        np.ones((1, 1), dtype=bool),
        np.array([[shape]]),
        np.array([[obstacle.position]]),
        np.array([[obstacle.rotation]]),
        np.array([[obstacle.velocity]]),
        np.array([[_outer(obstacle)]]),
    )


def at_origin(heading: float = 0.0) -> BodyStates:
    """A humanoid with all bodies at the pelvis, 0.9 m above the origin."""
    return BodyStates(
        np.tile([0.0, 0.0, 0.9], (1, 15, 1)),
        np.tile(from_axis_angle("Z", np.array(heading)), (1, 15, 1)),
        np.zeros((1, 15, 3)),
        np.zeros((1, 15, 3)),
    )


def test_a_box_ahead_is_where_it_stands() -> None:
    """Seen from a humanoid that faces along Y: a box 0.6 m ahead of it and 0.1 m to its left."""
    quarter = 0.5 * np.pi
    box = Obstacle("box", (0.3, 0.2, 0.4), (-0.1, 0.6, 0.2), velocity=(0.0, 2.0, 0.0))
    found = observe_obstacles(COUNT, one(box), at_origin(quarter), np.array([quarter]))[0]
    # Nearness; place; velocity; extent: it is 0.2 m long ahead and 0.3 m wide, as it stands across; a box.
    wanted = [1, 0.6, 0.1, 0.2, 2, 0, 0, 0.2, 0, 0, 0.3, 0, 0.4, 0]
    assert found[:OBSTACLE_SIZE] == pytest.approx(wanted, abs=1e-12)
    assert not found[OBSTACLE_SIZE : COUNT * OBSTACLE_SIZE].any()  # the places of a second and a third


def test_an_obstacle_fades_in_as_it_comes_nearer() -> None:
    seen = []
    for x in np.arange(2.2, 1.0, -0.01):
        ball = Obstacle("sphere", (0.3, 0.3, 0.3), (float(x), 0.0, 0.15))
        seen.append(observe_obstacles(1, one(ball), at_origin(), np.zeros(1))[0, :OBSTACLE_SIZE])
    nearness = np.array(seen)[:, 0]
    assert (nearness[:15] == 0.0).all()
    assert not np.array(seen)[:15].any()
    assert nearness[-1] == 1.0
    steps = np.diff(nearness)
    assert (steps >= 0.0).all()
    assert steps.max() < 0.02


def test_small_turns_of_an_obstacle_change_little_and_symmetries_nothing() -> None:
    """A lying cylinder that rolls, and one that is turned end for end, which axes with a sign would show."""
    lying = from_axis_angle("X", np.array(0.5 * np.pi))
    seen = []
    for roll in np.linspace(-0.05, 0.05, 11):
        turn = multiply(from_axis_angle("Y", np.array(roll)), lying)
        cylinder = Obstacle("cylinder", (0.3, 0.9, 0.6), (0.5, 0.0, 0.15), tuple(turn.tolist()))
        seen.append(observe_obstacles(1, one(cylinder), at_origin(), np.zeros(1))[0])
    assert np.abs(np.diff(seen, axis=0)).max() < 0.01
    # Of a cylinder, the second number means nothing.
    assert seen[5][7:13] == pytest.approx([0.3, 0, 0, 0.6, 0, 0.3], abs=1e-12)
    for axis, angle in (("X", np.pi), ("Z", 1.0)):
        turn = multiply(lying, from_axis_angle(axis, np.array(angle)))
        same = Obstacle("cylinder", (0.3, 0.9, 0.6), (0.5, 0.0, 0.15), tuple(turn.tolist()))
        np.testing.assert_allclose(
            observe_obstacles(1, one(same), at_origin(), np.zeros(1))[0], seen[5], atol=1e-12
        )


def test_the_nearest_come_first_and_no_more_than_asked_for() -> None:
    people, obstacles = bodies(4), scattered(4)
    all_of_them = observe_obstacles(6, obstacles, people, np.zeros(4))
    three = observe_obstacles(COUNT, obstacles, people, np.zeros(4))
    np.testing.assert_array_equal(three[:, : COUNT * OBSTACLE_SIZE], all_of_them[:, : COUNT * OBSTACLE_SIZE])
    np.testing.assert_array_equal(three[:, COUNT * OBSTACLE_SIZE :], all_of_them[:, 6 * OBSTACLE_SIZE :])
    nearness = all_of_them[:, : 6 * OBSTACLE_SIZE : OBSTACLE_SIZE]
    assert (np.diff(nearness, axis=1) <= 0.0).all()


def test_distances_from_the_legs_are_those_to_the_surfaces() -> None:
    """Against the signed distances of `overlap.py`, of points outside; the vector leads to the surface."""
    people, obstacles = bodies(6), scattered(6)
    legs = observe_obstacles(0, obstacles, people, np.zeros(6)).reshape(6, -1, 4)
    toes = BODY_INDEX["foot_right"]
    compared = 0
    for k in range(6):
        point = people.positions[k, toes] + rotate(people.rotations[k, toes], np.array([0.08, 0.0, -0.025]))
        items = [
            Obstacle(
                ("box", "sphere", "cylinder")[obstacles.shapes[k, n]],
                tuple(obstacles.sizes[k, n]),
                tuple(obstacles.positions[k, n]),
                tuple(obstacles.rotations[k, n]),
            )
            for n in range(6)
        ]
        gap = min(float(distance(item, point[None])[0]) for item in items)
        vector, nearness = legs[k, 4, :3], legs[k, 4, 3]
        assert nearness == pytest.approx(np.clip(1.0 - max(gap, 0.0) / 0.7, 0.0, 1.0), abs=1e-9)
        if 0.0 < gap < 0.7:
            compared += 1
            surface = point + 0.3 * vector / nearness
            assert min(abs(float(distance(item, surface[None])[0])) for item in items) < 1e-9
    assert compared >= 3


def test_turning_the_world_changes_nothing() -> None:
    people, obstacles, turn = bodies(5), scattered(5), from_axis_angle("Z", np.array(0.8))
    heading = np.linspace(-1.0, 1.0, 5)
    turned = replace(
        people, positions=rotate(turn, people.positions), rotations=multiply(turn, people.rotations)
    )
    moved = replace(
        obstacles,
        positions=rotate(turn, obstacles.positions),
        rotations=multiply(turn, obstacles.rotations),
        linear=rotate(turn, obstacles.linear),
    )
    before = observe_obstacles(COUNT, obstacles, people, heading)
    np.testing.assert_allclose(observe_obstacles(COUNT, moved, turned, heading + 0.8), before, atol=1e-12)


def test_the_mirror_image_is_the_reflection() -> None:
    people, obstacles, heading = bodies(5), scattered(5), np.linspace(-1.0, 1.0, 5)
    image = replace(
        people,
        positions=people.positions[:, COUNTERPARTS] * VECTOR,
        rotations=people.rotations[:, COUNTERPARTS] * QUATERNION,
    )
    moved = replace(
        obstacles,
        positions=obstacles.positions * VECTOR,
        rotations=obstacles.rotations * QUATERNION,
        linear=obstacles.linear * VECTOR,
    )
    sources, signs = obstacle_reflection(COUNT)
    before = observe_obstacles(COUNT, obstacles, people, heading)
    after = observe_obstacles(COUNT, moved, image, -heading)
    assert np.abs(after - before).max() > 0.1
    np.testing.assert_allclose(before[:, sources] * signs, after, atol=1e-12)


def test_only_what_is_there_is_observed() -> None:
    people, obstacles = bodies(3), scattered(3)
    hidden = replace(obstacles, there=np.arange(6) < np.array([[6], [2], [0]]))
    found = observe_obstacles(COUNT, hidden, people, np.zeros(3))
    first_two = ObstacleStates(*(column[:, :2] for column in vars(obstacles).values()))
    two = observe_obstacles(COUNT, first_two, people, np.zeros(3))
    np.testing.assert_array_equal(found[0], observe_obstacles(COUNT, obstacles, people, np.zeros(3))[0])
    np.testing.assert_array_equal(found[1], two[1])
    assert not found[2].any()
    nobody = observe_obstacles(COUNT, None, people, np.zeros(3))
    assert nobody.shape == (3, COUNT * OBSTACLE_SIZE + LEGS_SIZE)
    assert not nobody.any()


def test_the_states_are_the_worlds(world: World) -> None:
    assert obstacle_states(world) is None
    box = Obstacle("box", (0.3, 0.2, 0.1), (2.0, 0.05, 1.2), mass=5.0, velocity=(-1.0, 0.0, 1.0))
    ball = Obstacle("sphere", (0.2, 0.2, 0.2), (-2.0, 0.0, 0.1))
    world.place(0, [box, ball])
    found = obstacle_states(world)
    assert found is not None
    assert found.there.all()
    assert found.shapes.tolist() == [[BOX, SPHERE]]
    np.testing.assert_allclose(found.positions[0], [box.position, ball.position], atol=1e-12)
    np.testing.assert_allclose(found.rotations[0], np.tile(IDENTITY, (2, 1)), atol=1e-12)
    np.testing.assert_allclose(found.linear[0], [box.velocity, ball.velocity], atol=1e-12)
    np.testing.assert_array_equal(found.sizes[0], [box.size, ball.size])


def test_an_episode_among_obstacles_shows_them_at_the_end_of_the_observation(motion: Motion) -> None:
    config = EnvConfig(tracking=Tracking(), mirror=False, observed_obstacles=COUNT)
    blind = replace(config, observed_obstacles=0)
    for scene, seen in ((find_scenario("several-obstacles"), True), (None, False)):
        observed = []
        for env in (config, blind):
            batch = ImitationBatch(open_world(1, "pybullet"), Reference(motion), replace(env, scenario=scene))
            batch.reset(np.array([0]), np.array([0.3]), seeds=np.array([5], dtype=np.uint64))
            observed.append(batch.observe()[0])
            batch.world.close()
        size = len(observed[1])
        np.testing.assert_array_equal(observed[0][:size], observed[1])
        assert observed[0][size:].any() == seen
