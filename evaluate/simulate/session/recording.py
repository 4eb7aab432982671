"""A recorded session: a run folder with motion, policy and session.jsonl, every input with its step.

The first line of session.jsonl is the header; then come inputs, and once a second of simulation a digest of
the state. Every line is written at once, so that a killed process loses at most its last second.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, TypeVar

import msgspec
from msgspec import Meta, Struct

from kinemimic.evaluate.simulate.session.companions import AccompaniedSession
from kinemimic.evaluate.simulate.session.frame import Frame, LiveSettings, Score
from kinemimic.evaluate.simulate.session.inputs import Input, decoded
from kinemimic.evaluate.simulate.session.live_session import LiveSession
from kinemimic.evaluate.simulate.session.session import Session
from kinemimic.pipeline.errors import CaptureError, KinemimicError
from kinemimic.pipeline.files.store import copy_file, file_hash
from kinemimic.pipeline.files.validation.bounded import MEGABYTE, read_bounded
from kinemimic.pipeline.live.frame import CapturedFrame, checked_frame
from kinemimic.retarget.formats.motion_json import MOTION
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.config.tracker import STANDING
from kinemimic.train.prediction.predictor import SHIPPED, Predictor
from kinemimic.train.rollout.policy import POLICY, Policy, load_trained
from kinemimic.train.rollout.tracker_file import tracker_path
from kinemimic.train.scenario.scenario import Scenario
from kinemimic.train.sim.world import CONTROL_RATE
from kinemimic.train.task.observation_layout import layout

SESSION, SCHEMA = "session.jsonl", 2
COPIED = ("policy.json", POLICY)
DIGEST_INTERVAL = CONTROL_RATE  # control steps
T = TypeVar("T")
_LIMIT = 256 * MEGABYTE  # a million drags, or two hours of a live capture
MAX_STEPS = 2 * 3600 * CONTROL_RATE  # of a recording; a replay holds all of them in memory


class _Header(Struct):
    """The first line.

    speed: factor on the motion's speed; live: settings of a session that a live capture drives; predictor,
    standing: SHA-256 of its predictor and of its policy for a person on the spot, else "".
    """

    schema: int
    engine: str
    restart: bool = True
    speed: Annotated[float, Meta(ge=0.1, le=10.0)] = 1.0
    live: LiveSettings | None = None
    predictor: str = ""
    standing: str = ""


class _Line(Struct):
    """Before control step `step`: an input, a frame of a live capture, or a digest of the state; at the end,
    the score shown."""

    step: int
    input: dict[str, Any] | None = None
    frame: CapturedFrame | None = None
    digest: str | None = None
    score: dict[str, Any] | None = None


def begin_session(
    run: Path,
    engine: str,
    *,
    restart: bool = True,
    speed: float = 1.0,
    companions: int = 0,
    named: Callable[[str], Scenario],
) -> Session:
    """A session with a run's policy on its motion; raises KinemimicError as `load_trained` does."""
    motion, policy, record = load_trained(run)
    if speed != 1.0:
        motion = replace(motion, rate=motion.rate * speed)
    env = TrainConfig.from_json(record["config"]).measured_env
    if companions:
        return AccompaniedSession(
            motion, policy, env, engine, companions, restart=restart, scenario_named=named
        )
    return Session(motion, policy, env, engine, restart=restart, scenario_named=named)


def begin_live_session(
    run: Path, engine: str, settings: LiveSettings, *, restart: bool = True, named: Callable[[str], Scenario]
) -> LiveSession:
    """A session of a run's policy driven by a live capture; raises KinemimicError as `Policy.load` does."""
    policy, record = Policy.load(run / POLICY)
    env = TrainConfig.from_json(record["config"]).measured_env
    predictor, standing = Predictor.load(), _standing(env)
    return LiveSession(
        policy, env, engine, settings, predictor, standing, restart=restart, scenario_named=named
    )


def _standing(env: EnvConfig) -> Policy | None:
    """The shipped policy for a person on the spot; None for a tracker with other observations."""
    policy, record = Policy.load(tracker_path(STANDING))
    own = TrainConfig.from_json(record["config"]).env
    return policy if layout(own) == layout(env) else None


def replay_command(folder: Path) -> str:
    """The command that simulates a recording again."""
    return f"kinemimic evaluate --run {folder}"


def next_folder(recordings: Path) -> Path:
    """The first folder session-N that does not exist."""
    number = 1
    while (folder := recordings / f"session-{number}").exists():
        number += 1
    return folder


class Recorder:
    """Writes a session that begins now to a new folder. full: no more can be read back.

    OSError where the disk is full or the folder gone; nothing is left of a recording that cannot begin.
    """

    def __init__(
        self,
        folder: Path,
        run: Path,
        engine: str,
        *,
        restart: bool,
        speed: float = 1.0,
        live: LiveSettings | None = None,
    ) -> None:
        folder.mkdir(parents=True)
        self.folder, self._size, self._steps = folder, 0, 0
        try:
            header = _Header(SCHEMA, engine, restart, speed, live, *(_shipped() if live else ()))
            for name in COPIED if live else (MOTION, *COPIED):
                copy_file(run / name, folder / name)
            self._file = (folder / SESSION).open("x", encoding="utf-8")
            self._write(msgspec.to_builtins(header))
        except OSError:
            shutil.rmtree(folder, ignore_errors=True)
            raise

    @property
    def full(self) -> bool:
        """Whether the recording has reached the size or the length up to which `replay` reads."""
        return self._size > _LIMIT - MEGABYTE or self._steps >= MAX_STEPS

    def _write(self, line: Mapping[str, Any]) -> None:
        self._size += self._file.write(json.dumps(line, separators=(",", ":"), allow_nan=False) + "\n")
        self._file.flush()

    def input(self, step: int, event: Input | CapturedFrame) -> None:
        """An input that was applied before control step `step`, from 0."""
        kind = "frame" if isinstance(event, CapturedFrame) else "input"
        self._write({"step": step, kind: msgspec.to_builtins(event)})

    def advanced(self, session: Session) -> None:
        """A control step was done; every second, the digest of the state is written."""
        self._steps = session.step_count
        if session.step_count % DIGEST_INTERVAL == 0:
            self._write({"step": session.step_count, "digest": session.digest()})

    def close(self, session: Session) -> None:
        """End the recording with its score."""
        last = {"step": session.step_count, "digest": session.digest(), "score": _score(session)}
        with self._file:
            self._write(last)


class Replay:
    """A recorded session: iterating over it simulates it again, frame by frame, once. score: at its end.

    KinemimicError for a damaged file, and where the state differs from the recorded one: another processor or
    another version of the engine computes other last bits.
    """

    def __init__(self, folder: Path, *, named: Callable[[str], Scenario]) -> None:
        self._folder, self._named = folder, named
        self.score: Score | None = None

    def __iter__(self) -> Iterator[Frame]:
        path = self._folder / SESSION
        lines = _lines(path)
        number, text = next(lines, (1, b""))
        header = _decoded(path, number, text, _Header)
        if header.schema != SCHEMA:
            raise CaptureError(path, where="line 1", expected=f"schema {SCHEMA}", found=str(header.schema))
        if header.live and (header.predictor, header.standing) != _shipped():
            raise CaptureError(
                path,
                where="line 1",
                expected="a recording with the predictor and the policy for standing of this version",
                found="others" if header.predictor and header.standing else "one without",
                advice="replay it with the version that recorded it",
            )
        session = _begun(self._folder, header, self._named)
        try:
            yield from _replayed(path, lines, session)
            self.score = session.score()
        finally:
            session.close()


def _replayed(path: Path, lines: Iterator[tuple[int, bytes]], session: Session) -> Iterator[Frame]:
    """The frames of a session, from the lines behind the header."""
    for number, text in lines:
        line = _decoded(path, number, text, _Line)
        if line.step < session.step_count:
            found = f"{line.step} after {session.step_count}"
            raise CaptureError(path, where=f"line {number}", expected="steps in order", found=found)
        if line.step > min(session.step_count + DIGEST_INTERVAL, MAX_STEPS):
            expected = f"a line every {DIGEST_INTERVAL} control steps, {MAX_STEPS:,} at most"
            raise CaptureError(path, where=f"line {number}", expected=expected, found=f"step {line.step:,}")
        while session.step_count < line.step:
            yield session.advance()
        try:
            if line.input is not None:
                session.apply(decoded(json.dumps(line.input)))
            if line.frame is not None:
                session.apply(checked_frame(line.frame))
        except KinemimicError as error:
            raise KinemimicError(f"{path}, line {number}: {error}") from None
        if line.digest is not None and line.digest != session.digest():
            raise CaptureError(
                path,
                where=f"line {number}",
                expected=f"the recorded state after control step {line.step}",
                found="another: the engine, its version or the processor differs",
            )
        if line.score is not None and line.score != _score(session):
            raise CaptureError(
                path,
                where=f"line {number}",
                expected=f"the score that was shown, {json.dumps(line.score)}",
                found=f"{json.dumps(_score(session))}: another version computes it differently",
            )


def _score(session: Session) -> dict[str, float | None] | None:
    """The score that the page shows, as it is recorded; None before there is one."""
    score = session.score()
    return None if score is None else score.to_json()


def _shipped() -> tuple[str, str]:
    """SHA-256 of the predictor and of the policy for a person on the spot."""
    return file_hash(SHIPPED), file_hash(tracker_path(STANDING))


def _begun(folder: Path, header: _Header, named: Callable[[str], Scenario]) -> Session:
    if header.live is not None:
        return begin_live_session(folder, header.engine, header.live, restart=header.restart, named=named)
    return begin_session(folder, header.engine, restart=header.restart, speed=header.speed, named=named)


def _lines(path: Path) -> Iterator[tuple[int, bytes]]:
    """Numbers and content of the whole lines; a last one without its end was cut off by a kill."""
    try:
        content = read_bounded(path, _LIMIT, "a recorded session")
    except FileNotFoundError:
        raise CaptureError(path, expected="a recorded session", found="no file") from None
    yield from enumerate(content.split(b"\n")[:-1], start=1)


def _decoded(path: Path, number: int, text: bytes, kind: type[T]) -> T:
    try:
        # Recordings of version 0.4 may have a score with NaN, which is not JSON.
        return msgspec.json.decode(text.replace(b":NaN", b":null"), type=kind)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise CaptureError(
            path, where=f"line {number}", expected="a line of a recorded session", found=str(error)
        ) from None
