"""Join a policy trained among obstacles with the one that it started from.

Training among obstacles costs fit and strength against pushes elsewhere. The joined policy is one network
again: it learns by regression to act as the trained one where it observes an obstacle, and as the first one
elsewhere, in the states that it reaches itself (`lessons.py`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.arrays import Array, Floats
from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.parallel.task_pool import parallel_map
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.learning_control.distillation import fitted
from kinemimic.train.recovery.among_obstacles import begin_among_obstacles, survived_among_obstacles
from kinemimic.train.recovery.learning import MINIBATCH, Taught, push_survival
from kinemimic.train.recovery.lessons import BEFORE, HARDEST, NOISE, STEPS, UNPUSHED, Rows
from kinemimic.train.recovery.pushes import Pushes, pushed, walk_to
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import CONTROL_RATE
from kinemimic.train.task.env import ImitationBatch
from kinemimic.train.task.obstacle_observation import obstacle_observation_size

_AMONG_OBSTACLES = 8 * CONTROL_RATE  # control steps of a lesson
_TESTS, _TEST_SEED = 400, 0  # trials among obstacles


class Gate:
    """Acts as one policy where an observation has an obstacle, and as another elsewhere.

    obstacles: numbers at the end of an observation that are of obstacles.
    """

    def __init__(self, among: Policy, elsewhere: Policy, obstacles: int) -> None:
        self._among, self._elsewhere, self._obstacles = among, elsewhere, obstacles

    def act(self, observations: Array) -> Array:
        """Actions (N, 42) for observations (N, O)."""
        near = observations[:, -self._obstacles :].any(axis=1)
        actions = self._elsewhere.act(observations).astype(np.float64)
        if near.any():
            actions[near] = self._among.act(observations[near])
        return actions


def join(
    motion: Motion, trained: Policy, first: Policy, config: TrainConfig, *, workers: int, engine: str
) -> Taught:
    """The trained policy, joined with the first one (of as many observations), from which training started.

    Of the policies after each round, the one with the best mean of two shares is kept: of test pushes that it
    survives, and of trials among obstacles; the record has the shares of all. workers: processes that test
    them.
    """
    env = config.env
    if config.joining is None or not (env.observed_obstacles and env.domain_randomization.obstacles):
        raise ValueError("expected a configuration with joining, of a policy that observes obstacles")
    teacher = Gate(trained, first, obstacle_observation_size(config.env.observed_obstacles))
    pupils = list(_rounds(motion, teacher, trained, config, engine))
    tasks = [_Test(motion, policy, config, engine) for policy in (first, trained, *pupils)]
    shares = parallel_map(_shares, tasks, workers=workers)
    means = [sum(one) for one in shares[2:]]
    names = ("pushes", "obstacles")
    record = {
        "first": dict(zip(names, shares[0], strict=True)),
        "trained": dict(zip(names, shares[1], strict=True)),
        "survived_by_round": [dict(zip(names, one, strict=True)) for one in shares[2:]],
    }
    return Taught(pupils[means.index(max(means))], "joining", record)


def _rounds(
    motion: Motion, teacher: Gate, trained: Policy, config: TrainConfig, engine: str
) -> Iterator[Policy]:
    """The pupil after each round: it learns from all lessons so far, first of the teacher, then its own."""
    settings = config.joining
    assert settings is not None  # noqa: S101 (checked by the caller)
    random = np.random.default_rng(config.seed)
    world = open_world(settings.humanoids, engine)
    batch = ImitationBatch(world, Reference(motion), config.measured_env)
    lessons: list[tuple[Floats, Floats]] = []
    pupil: Policy | None = None
    with progress("joining", settings.rounds, unit="rounds") as bar:
        for number in range(settings.rounds):
            for noise in (0.0, NOISE):
                lessons.append(_lesson_among_obstacles(batch, teacher, pupil, noise, random))
                lessons.append(_lesson_with_pushes(batch, teacher, pupil, noise, random))
            seen, wanted = (np.concatenate(column) for column in zip(*lessons, strict=True))
            pupil = fitted(pupil or trained, seen, wanted, config.seed + number, MINIBATCH)
            del seen, wanted  # gigabytes
            yield pupil
            bar.advance()
    world.close()


def _lesson_among_obstacles(
    batch: ImitationBatch, teacher: Gate, pupil: Policy | None, noise: float, random: np.random.Generator
) -> tuple[Floats, Floats]:
    """Observations (R, O) of upright humanoids among obstacles, and the teacher's actions (R, 42) there."""
    rows = Rows(pupil, noise, batch.world.size, random)
    seen = begin_among_obstacles(batch, random)
    fallen = np.zeros(batch.world.size, dtype=np.bool_)
    for _ in range(_AMONG_OBSTACLES):
        seen = batch.step(rows.act(seen, teacher.act(seen), fallen)).observations
        fallen = fallen | batch.fallen()
    return rows.joined()


def _lesson_with_pushes(
    batch: ImitationBatch, teacher: Gate, pupil: Policy | None, noise: float, random: np.random.Generator
) -> tuple[Floats, Floats]:
    """The same of humanoids on free ground, most of which are pushed from anywhere."""
    count = batch.world.size
    forces = random.uniform(0.0, HARDEST, count) * (random.random(count) >= UNPUSHED)
    pushes = Pushes(random.random(count), forces, random.uniform(-np.pi, np.pi, count))
    rows = Rows(pupil, noise, count, random)
    fallen = np.zeros(count, dtype=np.bool_)

    def act(_: int, seen: Array) -> Array:
        return rows.act(seen, teacher.act(seen), fallen)

    walk_to(batch, teacher, pushes.phases - BEFORE / (CONTROL_RATE * batch.reference.duration))
    for step in range(-BEFORE, 0):
        batch.step(act(step, batch.observe()))
    for fallen in pushed(batch, pushes, STEPS, act):  # noqa: B007 (`act` reads it)
        pass
    return rows.joined()


@dataclass(frozen=True)
class _Test:
    motion: Motion
    policy: Policy
    config: TrainConfig
    engine: str


def _shares(test: _Test) -> tuple[float, float]:
    """Shares of test pushes, and of trials among obstacles, that a policy survives."""
    world = open_world(_TESTS, test.engine)
    batch = ImitationBatch(world, Reference(test.motion), test.config.measured_env)
    among = survived_among_obstacles(batch, test.policy, np.random.default_rng(_TEST_SEED))
    world.close()
    return push_survival(test.motion, test.policy, test.config, test.engine), float(among.mean())
