"""A tracker unlearns its systematic errors at knees and hips, on the motions of a library."""

from __future__ import annotations

import hashlib
import json
import shutil
import time
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array, Floats
from kinemimic.pipeline.cli.progress import activity, progress
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.provenance import provenance
from kinemimic.pipeline.files.store import atomic, file_hash
from kinemimic.pipeline.parallel.task_pool import parallel_map
from kinemimic.pipeline.run_folder.lock import locked
from kinemimic.pipeline.run_folder.stage import recovered, stage
from kinemimic.retarget.library.library_file import MANIFEST, read_library
from kinemimic.retarget.library.variants import SUBJECT as VARIANTS
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.learning_control.distillation import fitted
from kinemimic.train.reference.reference_library import ReferenceLibrary
from kinemimic.train.rollout.evaluation import Episode, Evaluation
from kinemimic.train.rollout.policy import POLICY, Policy
from kinemimic.train.rollout.tracker_file import load_tracker, tracker_path
from kinemimic.train.sampling.simulators import local_cores
from kinemimic.train.sim.engines import resolve
from kinemimic.train.tracker.lessons import ENVIRONMENTS, collect_lessons
from kinemimic.train.tracker.library_control import (
    HUMANOIDS,
    ITERATIONS,
    LONG,
    SHARES,
    STEPS,
    ControlTask,
    LibraryCorrections,
    library_corrections,
)
from kinemimic.train.tracker.performance import perform
from kinemimic.train.tracker.tables import reference_tables

ROUNDS = 1
LESSONS = 1_024  # control steps of each humanoid from which a round learns
MINIBATCH = 1_024
# Share of the learned weights in the mean with those before the round: with all of them, a tracker follows
# the joints more closely, and falls more often.
ADOPTED = 0.75
PHASES = (1 / 26, 9 / 26, 17 / 26)  # of the evaluations
_CHUNK = 48  # motions that one process simulates together
_PURPOSE = "learning control"  # in seconds_by
_PARTS = "corrections"  # folder of the parts of a round that is not complete


def correct_tracker(
    source: Path,
    out: Path,
    *,
    start: str = "tracker",
    rounds: int = ROUNDS,
    seed: int = 0,
    workers: int | None = None,
    engine: str = "auto",
) -> dict[str, Any]:
    """Correct a tracker on the cyclic motions of the split "train" of the library in `source`; returns the
    record of the corrected policy, which is written to `out`.

    Each round learns corrections for every motion by iterative learning control (`library_control.py`), and
    then one network for all of them by regression, whose weights are averaged with those before. Motions that
    the tracker cannot perform, and those that do not repeat themselves, teach it to act as before. A round is
    adopted if the mean R² at knee and hip, 0 after a fall, is larger than before on the recorded loops of the
    split "train", or on the variants of a library without any; otherwise the corrections end.
    start: name or folder of the tracker; workers, engine: as for `evaluate`. An interrupted call goes on
    where it was, with the same result. KinemimicError without a cyclic motion, and for a folder of others.
    """
    with locked(out):
        return _Correction(source, out, start, seed, workers, resolve(engine)).run(rounds)


@dataclass
class _State:
    """A tracker between two rounds, and the number of rounds before; over: none would be adopted."""

    policy: Policy
    record: dict[str, Any]
    rounds: int = 0
    over: bool = False


class _Correction:
    """The arguments of `correct_tracker`, and what it reads."""

    def __init__(
        self, source: Path, out: Path, start: str, seed: int, workers: int | None, engine: str
    ) -> None:
        self._out, self._seed, self._workers, self._engine = out, seed, workers, engine
        library, identity, path = read_library(source), file_hash(source / MANIFEST), tracker_path(start)
        trained = library.select("train")
        cyclic = np.array([library.entries[index].cyclic for index in trained], dtype=np.bool_)
        if not cyclic.any():
            raise KinemimicError(
                f"{source}: expected motions that repeat themselves in the split `train`, found none"
            )
        policy, record = load_tracker(path)
        self._config = TrainConfig.from_json(record["config"], path.with_suffix(".json"), ("config",))
        if observed := self._config.env.observed_obstacles:
            raise KinemimicError(
                f"{path}: expected a tracker without obstacles in its observation, found one with "
                f"{observed}; choose another --from"
            )
        self._inputs = {"library": identity, "policy": file_hash(path)}
        self._state = self._resumed(path) or _State(policy, record)
        self._tables = reference_tables(library, trained, out, identity)
        self._motions: NDArray[np.intp] = np.flatnonzero(cyclic)
        entries = [library.entries[index] for index in trained]
        gaits = np.array([entry.cyclic or entry.subject == VARIANTS for entry in entries])
        self._weights: Array = gaits / gaits.sum()
        recorded = [k for k in self._motions if entries[k].subject != VARIANTS]
        self._evaluated = np.array(recorded or self._motions, dtype=np.intp)

    def run(self, rounds: int) -> dict[str, Any]:
        """All rounds that are left."""
        torch.set_num_threads(local_cores())
        state = self._state
        if state.over or state.rounds >= rounds:
            shutil.rmtree(self._out / _PARTS, ignore_errors=True)
            return state.record
        before = self._evaluation(state.policy)
        while not state.over and state.rounds < rounds:
            begun = time.monotonic()
            found = self._corrections(state)
            corrected = self._taught(state, found)
            after = self._evaluation(corrected)
            state.over = _fit(after) <= _fit(before)
            state.record = self._record(state, found, after, time.monotonic() - begun)
            state.rounds += 1
            if not state.over:
                state.policy, before = corrected, after
            self._write(state, finished=state.over or state.rounds >= rounds)
        return state.record

    def _corrections(self, state: _State) -> LibraryCorrections:
        """Corrections of all cyclic motions; parts that were computed before an interruption are read."""
        env, folder = self._config.measured_env, self._out / _PARTS
        folder.mkdir(exist_ok=True)
        chunks = np.array_split(self._motions, -(-len(self._motions) // _CHUNK))
        # Parts of another tracker or library, which an interruption left, are not taken for these.
        of = hashlib.sha256(json.dumps([self._inputs, self._seed, self._engine]).encode()).hexdigest()[:16]
        paths = [folder / f"{of}-{state.rounds}-{number}.npz" for number in range(len(chunks))]
        left = [number for number, path in enumerate(paths) if not path.exists()]
        at_once = self._workers or local_cores()
        done = len(self._motions) - sum(len(chunks[number]) for number in left)
        what = f"corrections, round {state.rounds + 1}"
        with progress(what, len(self._motions), done=done, unit="motions") as bar:
            for first in range(0, len(left), at_once):
                mine = left[first : first + at_once]
                tasks = [ControlTask(self._tables, chunks[k], state.policy, env, self._engine) for k in mine]
                for k, part in zip(
                    mine, parallel_map(library_corrections, tasks, workers=at_once), strict=True
                ):
                    _save(paths[k], part)
                    bar.advance(len(chunks[k]))
        return LibraryCorrections.concatenated([_load(path) for path in paths])

    def _taught(self, state: _State, found: LibraryCorrections) -> Policy:
        """The tracker that has learned the corrections."""
        tables = np.zeros((len(self._weights), *found.tables.shape[1:]))
        tables[self._motions] = found.tables
        seed = (self._seed * 1_000 + state.rounds) % 2**63
        with progress("lessons", LESSONS * ENVIRONMENTS, unit="samples") as bar:
            observations, actions = collect_lessons(
                self._tables, tables, self._weights, state.policy, self._config.env, self._engine, LESSONS,
                seed, bar.advance,
            )  # fmt: skip
        with activity("regression"):
            learned = fitted(state.policy, observations, actions, seed, MINIBATCH)
        return _between(state.policy, learned, ADOPTED)

    def _evaluation(self, policy: Policy) -> list[Episode]:
        env, reward = self._config.measured_env, self._config.final_reward
        with activity("evaluation"):
            library = ReferenceLibrary.open(self._tables)
            return [
                episode
                for phase in PHASES
                for episode in perform(policy, library, self._evaluated, env, reward, self._engine, phase)
            ]

    def _samples(self) -> int:
        """Control steps of a round."""
        steps = STEPS * (ITERATIONS + 1) + LONG * len(SHARES)
        return steps * HUMANOIDS * len(self._motions) + LESSONS * ENVIRONMENTS

    def _record(
        self, state: _State, found: LibraryCorrections, episodes: list[Episode], seconds: float
    ) -> dict[str, Any]:
        """policy.json after a round."""
        record, config = state.record, {**state.record["config"], "start": self._inputs["policy"]}
        spent, samples = record.get("seconds_by", {}), record["samples"] + self._samples()
        evaluation = Evaluation.of_episodes(
            episodes, samples=samples, seconds=record["seconds"] + seconds, strength=0.0, corrected=True
        ).to_json()
        of_round = {
            "motions": len(found.learned),
            "learned": int(found.learned.sum()),
            "r2": round(0.5 * _fit(episodes), 4),
            "adopted": not state.over,
        }
        return {
            **record,
            "samples": samples,
            "seconds": round(record["seconds"] + seconds, 1),
            "seconds_by": {**spent, _PURPOSE: round(spent.get(_PURPOSE, 0.0) + seconds, 2)},
            "best": record["best"] if state.over else evaluation,
            "evaluations": [*record["evaluations"], evaluation],
            "config": config,
            "corrections": [*(record["corrections"] if state.rounds else []), of_round],
            "provenance": provenance("correct-tracker", inputs=self._inputs, config=config, seed=self._seed),
        }

    def _write(self, state: _State, *, finished: bool) -> None:
        state.record["finished"] = finished
        with stage(self._out, "train", unfinished=not finished) as out:
            state.policy.save(out / POLICY, state.record)
        shutil.rmtree(self._out / _PARTS)

    def _resumed(self, start: Path) -> _State | None:
        """The state after the rounds that an earlier call completed."""
        recovered(self._out)
        path = self._out / POLICY
        if not path.exists():
            return None
        policy, record = load_tracker(path)
        of = record["provenance"]
        if (of.get("inputs"), of.get("seed")) != (self._inputs, self._seed):
            raise KinemimicError(
                f"{path}: expected a correction of {start} on this library with this seed, found another "
                "policy; choose another --out"
            )
        rounds = record["corrections"]
        return _State(policy, record, len(rounds), over=not rounds[-1]["adopted"])


def _between(start: Policy, learned: Policy, share: float) -> Policy:
    """The mean of the weights, as in Wortsman et al. 2022, "Robust fine-tuning of zero-shot models"."""

    def mean(old: Floats, new: Floats) -> Floats:
        return np.asarray((1.0 - share) * old + share * new, dtype=np.float32)

    layers = tuple(
        (mean(old[0], new[0]), mean(old[1], new[1]))
        for old, new in zip(start.layers, learned.layers, strict=True)
    )
    return replace(start, layers=layers)


def _fit(episodes: list[Episode]) -> float:
    """Mean of the sums of both R², 0 after a fall."""
    return float(np.mean([episode.knee + episode.hip for episode in episodes]))


def _save(path: Path, found: LibraryCorrections) -> None:
    with atomic(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **{one.name: getattr(found, one.name) for one in fields(found)})


def _load(path: Path) -> LibraryCorrections:
    with np.load(path, allow_pickle=False) as arrays:
        return LibraryCorrections(**{one.name: arrays[one.name] for one in fields(LibraryCorrections)})
