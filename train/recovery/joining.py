"""Join a policy trained among obstacles with the one that it started from.

Training among obstacles costs fit and strength against pushes elsewhere. The joined policy is one network
again: it learns by regression to act as the trained one where it observes an obstacle, and as the first one
elsewhere, in the states that it reaches itself (`lessons.py`).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kinemimic.pipeline.arrays import Array, Floats
from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.files.store import content_hash
from kinemimic.pipeline.parallel.task_pool import parallel_map
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.joining import Joining
from kinemimic.train.learning_control.distillation import fitted
from kinemimic.train.recovery.among_obstacles import begin_among_obstacles, survived_among_obstacles
from kinemimic.train.recovery.learning import MINIBATCH, Taught, push_survival
from kinemimic.train.recovery.lessons import BEFORE, HARDEST, NOISE, STEPS, UNPUSHED, Rows, pushed_rows
from kinemimic.train.recovery.pupils_file import PUPILS, read_pupils, write_pupils
from kinemimic.train.recovery.pushes import Pushes
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import CONTROL_RATE
from kinemimic.train.task.env import ACTIONS, ImitationBatch
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
    motion: Motion,
    trained: Policy,
    first: Policy,
    config: TrainConfig,
    run: Path,
    *,
    workers: int,
    engine: str,
) -> Taught:
    """The trained policy, joined with the first one (of as many observations), from which training started.

    Of the policies after each round, the one with the best mean of two shares is kept: of test pushes that it
    survives, and of trials among obstacles; the record has the shares of all. run: the folder in which
    finished rounds are kept. workers: processes that test the policies.
    """
    env = config.env
    if config.joining is None or not (env.observed_obstacles and env.domain_randomization.obstacles):
        raise ValueError("expected a configuration with joining, of a policy that observes obstacles")
    pupils = _pupils(motion, trained, first, config, config.joining, run / PUPILS, engine)
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


def _pupils(
    motion: Motion,
    trained: Policy,
    first: Policy,
    config: TrainConfig,
    settings: Joining,
    path: Path,
    engine: str,
) -> list[Policy]:
    """The pupil after each round: it learns from all lessons so far, first of the teacher, then its own.

    Of rounds whose pupil is in the file at `path`, only the lessons are given again.
    """
    identity = {
        "trained": content_hash(trained.tensors()), "first": content_hash(first.tensors()),
        "motion": motion.identity, "engine": engine, "seed": str(config.seed),
        "humanoids": str(settings.humanoids),
    }  # fmt: skip
    pupils = read_pupils(path, identity, config)
    if len(pupils) >= settings.rounds:
        return pupils[: settings.rounds]
    teacher = Gate(trained, first, obstacle_observation_size(config.env.observed_obstacles))
    random = np.random.default_rng(config.seed)
    world = open_world(settings.humanoids, engine)
    batch = ImitationBatch(world, Reference(motion), config.measured_env)
    lessons = _Lessons(settings, trained.shape[0])
    with progress("joining", settings.rounds, done=len(pupils), unit="rounds") as bar:
        for number in range(settings.rounds):
            pupil = pupils[number - 1] if number else None
            for noise in (0.0, NOISE):
                lessons.add(*_lesson_among_obstacles(batch, teacher, pupil, noise, random))
                lessons.add(*_lesson_with_pushes(batch, teacher, pupil, noise, random))
            if number < len(pupils):
                continue
            pupils.append(fitted(pupil or trained, *lessons.all(), config.seed + number, MINIBATCH))
            write_pupils(path, identity, pupils)
            bar.advance()
    world.close()
    return pupils


class _Lessons:
    """Rows of all lessons so far: gigabytes, and so in one place from the start."""

    def __init__(self, settings: Joining, observations: int) -> None:
        most = settings.rounds * 2 * settings.humanoids * (_AMONG_OBSTACLES + BEFORE + STEPS)
        self._seen = np.empty((most, observations), dtype=np.float32)
        self._wanted = np.empty((most, ACTIONS), dtype=np.float32)
        self._count = 0

    def add(self, seen: Floats, wanted: Floats) -> None:
        """Observations (R, O), and the teacher's actions (R, 42)."""
        rows = slice(self._count, self._count + len(seen))
        self._seen[rows], self._wanted[rows] = seen, wanted
        self._count = rows.stop

    def all(self) -> tuple[Floats, Floats]:
        """Observations and actions of all lessons, as views."""
        return self._seen[: self._count], self._wanted[: self._count]


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
    return pushed_rows(batch, teacher, pushes, rows, lambda _, seen: teacher.act(seen))


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
