"""Events drawn from a scenario: time, place, size."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from peers.elsewhere import turned

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.gravity import GRAVITY
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, multiply, rotate
from kinemimic.retarget.humanoid.body import BODIES, BODY_INDEX, TOTAL_MASS
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.reference.reference import Reference
from kinemimic.train.scenario.event_schedule import EventSchedule, draw_event_schedule, with_states
from kinemimic.train.scenario.overlap import distance, obstacles_overlap, overlapping_body
from kinemimic.train.scenario.route import reference_for
from kinemimic.train.scenario.scenario import Load, Placement, Range, Scenario
from kinemimic.train.sim.world import BodyStates, Obstacle

TORSO = BODY_INDEX["torso"]
PULL = Load("torso", Range.of(1.0), Range.of(0.5), force=Range.of(100.0, 10.0, 0.0))
BOX = Placement("box", Range.of(0.2, 0.4, 0.6), Range.of(2.0, 0.5))


def drawn(motion: Motion, scenario: Scenario, phase: float = 0.0, seed: int = 0) -> EventSchedule:
    return draw_event_schedule(scenario, Reference(motion), phase, np.random.default_rng(seed))


def test_a_force_acts_during_its_interval(motion: Motion) -> None:
    schedule = drawn(motion, Scenario("pull", loads=(PULL,)))
    assert schedule.wrench(29) is None
    assert schedule.wrench(45) is None
    for age in (30, 44):
        wrench = schedule.wrench(age)
        assert wrench is not None
        np.testing.assert_allclose(wrench[TORSO], [100.0, 10.0, 0.0, 0.0, 0.0, 0.0], atol=1e-9)
        assert not np.delete(wrench, TORSO, axis=0).any()


def test_a_growing_load_is_linear_and_gives_half_the_impulse(motion: Motion) -> None:
    schedule = drawn(motion, Scenario("pull", loads=(replace(PULL, growing=True),)))
    forces = [schedule.wrench(age)[TORSO, 0] for age in range(30, 45)]  # type: ignore[index]
    np.testing.assert_allclose(np.diff(forces), 100.0 / 15)
    assert sum(forces) / 30 == pytest.approx(0.5 * 100.0 * 0.5)


def test_loads_on_one_body_add_up(motion: Motion) -> None:
    turn = Load("torso", Range.of(1.2), Range.of(1.0), torque=Range.of(0.0, 0.0, 7.0))
    wrench = drawn(motion, Scenario("both", loads=(PULL, turn, PULL))).wrench(40)
    assert wrench is not None
    np.testing.assert_allclose(wrench[TORSO], [200.0, 20.0, 0.0, 0.0, 0.0, 7.0], atol=1e-9)


def test_ahead_is_the_heading_of_the_reference(motion: Motion) -> None:
    """A rotated motion rotates its scenario."""
    scene = Scenario("both", loads=(PULL,), obstacles=(replace(BOX, velocity=Range.of(1.0, 2.0, 3.0)),))
    straight, other = drawn(motion, scene, 0.3), drawn(turned(motion, 1.1), scene, 0.3)
    turn = from_axis_angle("Z", 1.1)
    np.testing.assert_allclose(other.wrenches[0, :3], rotate(turn, straight.wrenches[0, :3]), atol=1e-9)
    (_, before), (_, after) = straight.releases[0], other.releases[0]
    np.testing.assert_allclose(after.position, rotate(turn, np.array(before.position)), atol=1e-9)
    np.testing.assert_allclose(after.velocity, rotate(turn, np.array([1.0, 2.0, 3.0])), atol=1e-9)
    assert abs(np.dot(after.rotation, multiply(turn, np.array(before.rotation)))) == pytest.approx(1.0)


def test_obstacles_stand_on_the_ground_or_at_their_height(motion: Motion) -> None:
    reference = Reference(motion)
    high = replace(BOX, position=Range.of(2.0, 0.5, 1.4), at=Range.of(2.0))
    schedule = draw_event_schedule(
        Scenario("two", obstacles=(high, BOX)), reference, 0.5, np.random.default_rng(0)
    )
    (first, standing), (second, hanging) = schedule.releases
    assert (first, second) == (0, 60)
    start, later = reference.root(0.5 + np.array([0.0, 2.0 / reference.duration]))
    np.testing.assert_allclose(standing.position, [start[0] + 2.0, start[1] + 0.5, 0.3], atol=1e-9)
    np.testing.assert_allclose(hanging.position, [later[0] + 2.0, later[1] + 0.5, 1.4], atol=1e-9)
    assert [len(schedule.released(age)) for age in (0, 1, 60, 61)] == [0, 1, 1, 2]


def test_obstacles_on_a_route_are_relative_to_its_origin(motion: Motion) -> None:
    scene = Scenario("bent", route=((3.0, 1.0),), obstacles=(BOX,))
    schedule = draw_event_schedule(scene, reference_for(motion, scene), 0.7, np.random.default_rng(0))
    np.testing.assert_allclose(schedule.releases[0][1].position, [2.0, 0.5, 0.3], atol=1e-9)


def test_a_slope_tilts_gravity(motion: Motion) -> None:
    angle = math.radians(10.0)
    wrench = drawn(motion, Scenario("hill", slope=Range.of(angle))).wrench(0, mass=1.1)
    assert wrench is not None
    total = wrench[:, :3].sum(axis=0)
    weight = 1.1 * TOTAL_MASS * GRAVITY
    total[2] -= weight
    np.testing.assert_allclose(total, [-weight * math.sin(angle), 0.0, -weight * math.cos(angle)], atol=1e-9)


def test_draws_are_reproducible_and_fill_their_ranges(motion: Motion) -> None:
    scene = Scenario(
        "ranges",
        friction=Range((0.3,), (0.7,)),
        loads=(replace(PULL, at=Range((0.5,), (2.5,)), force=Range((0.0, 0.0, 0.0), (50.0, 0.0, 0.0))),),
    )
    schedules = [drawn(motion, scene, seed=seed) for seed in range(300)]
    assert drawn(motion, scene, seed=7).wrenches[0, 0] == schedules[7].wrenches[0, 0]
    for values, low, high in (
        ([schedule.friction for schedule in schedules], 0.3, 0.7),
        ([schedule.begins[0] for schedule in schedules], 15, 75),
        ([schedule.wrenches[0, 0] for schedule in schedules], 0.0, 50.0),
    ):
        found = np.array(values, dtype=np.float64)
        assert low <= found.min() < low + 0.05 * (high - low)
        assert high - 0.05 * (high - low) < found.max() <= high


def test_an_obstacle_in_the_humanoid_is_redrawn_or_refused(motion: Motion) -> None:
    within = replace(BOX, position=Range.of(0.1, 0.0))
    line = r"scenario room: expected obstacle 2 \(box\) apart from .*, found it in \w+ 0.00 s after the start"
    with pytest.raises(KinemimicError, match=line):
        drawn(motion, Scenario("room", obstacles=(BOX, within)))
    sometimes = replace(BOX, position=Range((0.0, 0.0), (3.0, 0.0)))
    reference = Reference(motion).bodies(np.array([0.0]))
    humanoid = BodyStates(*(values[0] for values in vars(reference).values()))
    for seed in range(30):
        ((_, item),) = drawn(motion, Scenario("room", obstacles=(sometimes,)), seed=seed).releases
        assert overlapping_body(item, humanoid) is None


QUARTER = (0.0, 0.0, 0.5**0.5, 0.5**0.5)


@pytest.mark.parametrize(
    ("item", "point", "expected"),
    [
        (Obstacle("sphere", (2.0, 2.0, 2.0), (1.0, 0.0, 0.0)), (4.0, 0.0, 0.0), 2.0),
        (Obstacle("sphere", (2.0, 2.0, 2.0), (1.0, 0.0, 0.0)), (1.0, 0.5, 0.0), -0.5),
        (Obstacle("box", (2.0, 4.0, 6.0), (0.0, 0.0, 3.0)), (4.0, 6.0, 3.0), 5.0),
        (Obstacle("box", (2.0, 4.0, 6.0), (0.0, 0.0, 3.0)), (0.5, 0.0, 3.0), -0.5),
        (Obstacle("box", (2.0, 4.0, 6.0), (0.0, 0.0, 3.0), QUARTER), (5.0, 0.0, 3.0), 3.0),
        (Obstacle("cylinder", (2.0, 2.0, 4.0), (0.0, 0.0, 2.0)), (4.0, 0.0, 8.0), 5.0),
        (Obstacle("cylinder", (2.0, 2.0, 4.0), (0.0, 0.0, 2.0)), (0.0, 0.75, 2.0), -0.25),
    ],
)  # fmt: skip
def test_distances_from_shapes(item: Obstacle, point: tuple[float, ...], expected: float) -> None:
    assert distance(item, np.array([point]))[0] == pytest.approx(expected)


def test_simultaneous_obstacles_do_not_overlap(motion: Motion) -> None:
    crowd = Scenario("crowd", obstacles=(replace(BOX, position=Range((1.5, -0.4), (2.5, 0.4))),) * 4)
    for seed in range(20):
        items = [item for _, item in drawn(motion, crowd, seed=seed).releases]
        assert not any(obstacles_overlap(a, b) for k, a in enumerate(items) for b in items[:k])
    with pytest.raises(KinemimicError, match=r"expected obstacle 2 .*found it in obstacle 1 "):
        drawn(motion, Scenario("twice", obstacles=(BOX, BOX)))
    # What appears later may lie where something was.
    later = drawn(motion, Scenario("later", obstacles=(BOX, replace(BOX, at=Range.of(3.0)))))
    assert len(later.releases) == 2


SLAB = Obstacle("box", (2.0, 1.0, 0.5), (0.0, 0.0, 0.25))
POST = Obstacle("cylinder", (1.0, 1.0, 2.0), (0.0, 0.0, 1.0))


@pytest.mark.parametrize(
    ("a", "b", "expected"),
    [
        (SLAB, replace(SLAB, position=(1.9, 0.0, 0.25)), True),
        (SLAB, replace(SLAB, position=(2.0, 0.0, 0.25)), False),
        (SLAB, replace(SLAB, position=(0.0, 0.0, 0.75)), False),
        (SLAB, replace(SLAB, position=(0.0, 0.0, 0.7)), True),
        (SLAB, replace(SLAB, position=(1.55, 0.0, 0.25), rotation=QUARTER), False),
        (SLAB, replace(SLAB, position=(1.45, 0.0, 0.25), rotation=QUARTER), True),
        # Turned by 45 degrees, its corner reaches 1.06 m: boxes around both would meet, they do not.
        (SLAB, replace(SLAB, position=(1.75, 1.35, 0.25), rotation=(0.0, 0.0, 0.3826834, 0.9238795)), False),
        (SLAB, replace(POST, position=(1.45, 0.0, 1.0)), True),
        (SLAB, replace(POST, position=(1.4, 0.9, 1.0)), False),
        (POST, replace(POST, position=(0.99, 0.0, 1.0)), True),
        (POST, replace(POST, position=(1.0, 0.0, 1.0)), False),
    ],
)
def test_overlap_of_obstacles(a: Obstacle, b: Obstacle, expected: bool) -> None:
    assert obstacles_overlap(a, b) is expected
    assert obstacles_overlap(b, a) is expected


def test_every_body_is_found_by_a_small_ball_anywhere_in_it(motion: Motion) -> None:
    bodies = Reference(motion).bodies(np.array([0.2]))
    humanoid = BodyStates(*(values[0] for values in vars(bodies).values()))
    random = np.random.default_rng(0)
    for k, body in enumerate(BODIES):
        for _ in range(10):
            arm = 0.5 * np.array(body.size) * random.uniform(-0.5, 0.5, 3)
            place = humanoid.positions[k] + rotate(humanoid.rotations[k], arm)
            pin = Obstacle("sphere", (0.06, 0.06, 0.06), tuple(place.tolist()))
            assert overlapping_body(pin, humanoid) is not None, body.name


def test_every_body_is_found_by_a_pin_in_its_middle(motion: Motion) -> None:
    bodies = Reference(motion).bodies(np.array([0.2]))
    humanoid = BodyStates(*(values[0] for values in vars(bodies).values()))
    for k, body in enumerate(BODIES):
        pin = Obstacle("sphere", (0.06, 0.06, 0.06), tuple(humanoid.positions[k].tolist()))
        assert overlapping_body(pin, humanoid) is not None, body.name
    assert overlapping_body(Obstacle("sphere", (0.1, 0.1, 0.1), (0.0, 0.0, 3.0)), humanoid) is None


def test_obstacles_take_the_states_of_a_world() -> None:
    item = Obstacle("box", (1.0, 1.0, 1.0), (0.0, 0.0, 0.5), mass=2.0)
    (moved,) = with_states([item], np.arange(13.0)[None])
    assert (moved.position, moved.rotation) == ((0.0, 1.0, 2.0), (3.0, 4.0, 5.0, 6.0))
    assert (moved.velocity, moved.spin, moved.mass) == ((7.0, 8.0, 9.0), (10.0, 11.0, 12.0), 2.0)
