"""A policy learns recoveries: search, lessons and regression."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import content_hash, read_json, write_json
from kinemimic.pipeline.parallel.task_pool import parallel_map
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.recovery import Recovery
from kinemimic.train.learning_control.distillation import fitted
from kinemimic.train.recovery.lessons import NOISE, Teacher, lesson
from kinemimic.train.recovery.pushes import Pushes, survived
from kinemimic.train.recovery.search import Found, SearchTask, search
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.sim.engines import open_world
from kinemimic.train.task.env import ImitationBatch
from kinemimic.train.task.mirror import mirrored

SEARCHES = "recoveries.json"  # in the run folder: what was found, so that an interrupted search goes on
RECOVERIES_SCHEMA = 1
MINIBATCH = 2_048
# Pushes by which the policy of a round is compared with that of the round before: at every phase, from these
# directions, at these forces.
_TEST_PHASES, _TEST_DIRECTIONS = 10, 8
_TEST_FORCES = (150.0, 200.0, 250.0, 300.0, 350.0)


@dataclass(frozen=True)
class Taught:
    """A policy that was taught after its training. record: what policy.json says about it, under `stage`."""

    policy: Policy
    stage: str
    record: dict[str, Any]


def learn_recoveries(
    motion: Motion, policy: Policy, config: TrainConfig, run: Path, *, workers: int, engine: str
) -> Taught:
    """Teach a policy to survive pushes from the directions of `config.recovery`.

    Maneuvers are searched for each direction, around each phase, in `workers` processes. Those that survive
    most pushes are taught in rounds. The policy of the round that survives most test pushes from all
    directions is kept; that may be the policy as it was.
    """
    settings = config.recovery
    if settings is None:
        raise ValueError("expected a configuration with recoveries")
    found = _found(motion, policy, config, settings, run / SEARCHES, workers, engine)
    # Where no maneuver is good enough, the pupil continues to act as before.
    taught = [one if one.after >= settings.taught else replace(one, knots=0.0 * one.knots) for one in found]
    shares = [push_survival(motion, policy, config, engine)]
    best = policy
    if maneuvers := sum(one.knots.any() for one in taught):
        teacher = Teacher(policy, taught, 0.5 / settings.phases)
        for pupil in _rounds(motion, teacher, config, settings, engine):
            shares.append(push_survival(motion, pupil, config, engine))
            if shares[-1] == max(shares):
                best = pupil
    record = {
        "policy": content_hash(policy.tensors()),
        "searches": len(found),
        "taught": int(maneuvers),
        "samples": sum(one.samples for one in found),
        "survived_before": float(np.mean([one.before for one in found])),
        "survived_by_maneuver": float(np.mean([one.after for one in found])),
        "survived_by_round": shares,
    }
    return Taught(best, "recovery", record)


def phases_of(motion: Motion, config: TrainConfig, count: int) -> Array:
    """The middles of `count` equal parts of the cycle; those of its first half where the policy mirrors."""
    phases: Array = (np.arange(count) + 0.5) / count
    return phases[: -(-count // 2)] if mirrored(config.env, Reference(motion)) else phases


def _found(
    motion: Motion,
    policy: Policy,
    config: TrainConfig,
    settings: Recovery,
    path: Path,
    workers: int,
    engine: str,
) -> list[Found]:
    """The results of all searches; those in the file at `path` are not done again."""
    places = [
        (float(np.radians(direction)), float(phase))
        for direction in settings.directions
        for phase in phases_of(motion, config, settings.phases)
    ]
    seeds = np.random.SeedSequence(config.seed).spawn(len(places))
    of_search = ("phases", "directions", "forces", "candidates", "elite", "iterations")
    identity = {
        "schema": RECOVERIES_SCHEMA, "policy": content_hash(policy.tensors()),
        "motion": motion.identity, "engine": engine, "seed": config.seed,
        "settings": {name: json.loads(json.dumps(getattr(settings, name))) for name in of_search},
    }  # fmt: skip
    done = _stored(path, identity)
    with progress("recoveries", len(places), done=len(done), unit="searches") as bar:
        while len(done) < len(places):
            part = range(len(done), min(len(done) + workers, len(places)))
            tasks = [
                SearchTask(
                    motion, policy, config.measured_env, settings, places[k][1], 0.5 / settings.phases,
                    places[k][0], seeds[k], engine,
                )
                for k in part
            ]  # fmt: skip
            done += parallel_map(search, tasks, workers=workers, progress=bar.advance)
            stored = [{**asdict(one), "knots": one.knots.tolist()} for one in done]
            write_json(path, {**identity, "found": stored})
    return done


def _stored(path: Path, identity: Mapping[str, Any]) -> list[Found]:
    """Results in a file of the same policy and settings; none if there is no such file."""
    try:
        stored = read_json(path)
        if {key: stored.get(key) for key in identity} != dict(identity):
            return []
        return [Found(**{**one, "knots": np.array(one["knots"])}) for one in stored["found"]]
    except (FileNotFoundError, KinemimicError, AttributeError, KeyError, TypeError, ValueError):
        return []


def _rounds(
    motion: Motion, teacher: Teacher, config: TrainConfig, settings: Recovery, engine: str
) -> list[Policy]:
    """The pupil after each round: it learns from all lessons so far, first of the teacher, then its own."""
    random = np.random.default_rng(config.seed)
    world = open_world(settings.humanoids, engine)
    batch = ImitationBatch(world, Reference(motion), config.measured_env)
    lessons = []
    pupils: list[Policy] = []
    with progress("lessons", settings.rounds, unit="rounds") as bar:
        for number in range(settings.rounds):
            pupil = pupils[-1] if pupils else None
            lessons += [lesson(batch, teacher, pupil, settings, noise, random) for noise in (0.0, NOISE)]
            seen, wanted = (np.concatenate(column) for column in zip(*lessons, strict=True))
            pupils.append(fitted(pupil or teacher.policy, seen, wanted, config.seed + number, MINIBATCH))
            bar.advance()
    world.close()
    return pupils


def push_survival(motion: Motion, policy: Policy, config: TrainConfig, engine: str) -> float:
    """Share of the test pushes that a policy survives."""
    phases = np.arange(_TEST_PHASES) / _TEST_PHASES
    angles = 2.0 * np.pi * np.arange(_TEST_DIRECTIONS) / _TEST_DIRECTIONS
    grid = np.meshgrid(phases, np.array(_TEST_FORCES), angles, indexing="ij")
    pushes = Pushes(*(values.ravel() for values in grid))
    world = open_world(len(pushes.forces), engine)
    batch = ImitationBatch(world, Reference(motion), config.measured_env)
    share = float(survived(batch, policy, pushes).mean())
    world.close()
    return share
