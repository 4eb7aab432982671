"""Join policies that walk through obstacles with one that withstands pushes.

The joined policy is one network: it learns by regression to act as the first ones, its teachers, where it
observes an obstacle, and as the other elsewhere, in the states that it reaches itself (`lessons.py`).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kinemimic.pipeline.arrays import Array, Floats
from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import content_hash
from kinemimic.pipeline.parallel.task_pool import parallel_map
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.joining import Joining
from kinemimic.train.learning_control.distillation import fitted
from kinemimic.train.recovery.among_obstacles import begin_among_obstacles, survived_among_obstacles
from kinemimic.train.recovery.learning import Taught, push_survival
from kinemimic.train.recovery.lessons import BEFORE, HARDEST, NOISE, STEPS, UNPUSHED, Rows, pushed_rows
from kinemimic.train.recovery.pupils_file import PUPILS, read_pupils, write_pupils
from kinemimic.train.recovery.pushes import Pushes
from kinemimic.train.recovery.teachers import TaughtActions, Teachers
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import CONTROL_RATE
from kinemimic.train.task.env import ACTIONS, ImitationBatch
from kinemimic.train.task.obstacle_observation import obstacle_observation_size

_AMONG_OBSTACLES = 8 * CONTROL_RATE  # control steps of a lesson
_NOISES = (0.0, NOISE)  # of the lessons of a round
# The policy has to learn the teachers' whole gait, more than recoveries: with 2,048, it took too few steps.
_MINIBATCH = 512
_TESTS, _TEST_SEED = 200, 0  # trials among obstacles


class Gate:
    """Acts as teachers where an observation has an obstacle, and as another policy elsewhere.

    batch: whose states the teachers see.
    """

    def __init__(self, batch: ImitationBatch, teachers: Teachers, elsewhere: Policy) -> None:
        self._taught, self._elsewhere = TaughtActions(batch, teachers), elsewhere
        self._obstacles = obstacle_observation_size(batch.config.observed_obstacles)

    def act(self, observations: Array) -> Array:
        """Actions (N, 42) for observations (N, O) of the batch in its current state."""
        near = observations[:, -self._obstacles :].any(axis=1)
        actions = self._elsewhere.act(observations).astype(np.float64)
        if near.any():
            actions[near] = self._taught.act()[near]
        return actions


def join(
    motion: Motion,
    first: Policy,
    teachers: Teachers,
    config: TrainConfig,
    run: Path,
    *,
    workers: int,
    engine: str,
) -> Taught:
    """One policy that acts as the teachers near obstacles, and elsewhere as `first`, from which it starts.

    Of the policies after each round, the one with the best mean of two shares is kept: of test pushes that it
    survives, and of trials among obstacles; the record has the shares of all. run: the folder in which
    finished rounds are kept. workers: processes that test the policies. KinemimicError if the teachers do not
    help.
    """
    env = config.env
    if config.joining is None or not (env.observed_obstacles and env.domain_randomization.obstacles):
        raise ValueError("expected a configuration with joining, of a policy that observes obstacles")
    before = [_Test(motion, first, config, engine), _Test(motion, first, config, engine, teachers)]
    alone, together = parallel_map(_shares, before, workers=workers)
    if together[1] <= alone[1]:
        raise KinemimicError(
            f"--teachers: expected policies that survive more trials among obstacles than without them "
            f"({alone[1]:.0%}), found {together[1]:.0%}; were they trained on this motion?"
        )
    pupils = _pupils(motion, first, teachers, config, config.joining, run / PUPILS, engine)
    tests = [_Test(motion, policy, config, engine) for policy in pupils]
    shares = parallel_map(_shares, tests, workers=workers)
    names = ("pushes", "obstacles")
    record = {
        "teachers": teachers.identity,
        "first": dict(zip(names, alone, strict=True)),
        "first_and_teachers": dict(zip(names, together, strict=True)),
        "survived_by_round": [dict(zip(names, one, strict=True)) for one in shares],
    }
    best = max(range(len(pupils)), key=lambda k: sum(shares[k]))
    return Taught(pupils[best], "joining", record)


def _pupils(
    motion: Motion,
    first: Policy,
    teachers: Teachers,
    config: TrainConfig,
    settings: Joining,
    path: Path,
    engine: str,
) -> list[Policy]:
    """The pupil after each round: it learns from all lessons so far, first of the teacher, then its own.

    Of rounds whose pupil is in the file at `path`, only the lessons are given again.
    """
    identity = {
        "first": content_hash(first.tensors()), "teachers": teachers.identity,
        "motion": motion.identity, "engine": engine, "seed": str(config.seed),
        "humanoids": str(settings.humanoids),
    }  # fmt: skip
    pupils = read_pupils(path, identity, config)
    if len(pupils) >= settings.rounds:
        return pupils[: settings.rounds]
    random = np.random.default_rng(config.seed)
    world = open_world(settings.humanoids, engine)
    batch = ImitationBatch(world, Reference(motion), config.measured_env)
    teacher = Gate(batch, teachers, first)
    lessons = _Lessons(settings, first.shape[0])
    with progress("joining", settings.rounds, done=len(pupils), unit="rounds") as bar:
        for number in range(settings.rounds):
            pupil = pupils[number - 1] if number else None
            for noise in _NOISES:
                lessons.add(*_lesson_among_obstacles(batch, teacher, pupil, noise, random))
                lessons.add(*_lesson_with_pushes(batch, teacher, pupil, noise, random))
            if number < len(pupils):
                continue
            pupils.append(fitted(pupil or first, *lessons.all(), config.seed + number, _MINIBATCH))
            write_pupils(path, identity, pupils)
            bar.advance()
    world.close()
    return pupils


def lesson_samples(settings: Joining) -> int:
    """Control steps of all lessons, if nobody falls."""
    return settings.rounds * len(_NOISES) * settings.humanoids * (_AMONG_OBSTACLES + BEFORE + STEPS)


class _Lessons:
    """Rows of all lessons so far: gigabytes, and so in one place from the start."""

    def __init__(self, settings: Joining, observations: int) -> None:
        most = lesson_samples(settings)
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
    """teachers: act in place of the policy near obstacles."""

    motion: Motion
    policy: Policy
    config: TrainConfig
    engine: str
    teachers: Teachers | None = None


def _shares(test: _Test) -> tuple[float, float]:
    """Shares of test pushes, and of trials among obstacles, that a policy survives."""
    world = open_world(_TESTS, test.engine)
    batch = ImitationBatch(world, Reference(test.motion), test.config.measured_env)
    acting = test.policy if test.teachers is None else Gate(batch, test.teachers, test.policy)
    among = survived_among_obstacles(batch, acting, np.random.default_rng(_TEST_SEED))
    world.close()
    return push_survival(test.motion, test.policy, test.config, test.engine), float(among.mean())
