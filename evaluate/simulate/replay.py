"""A recorded session, simulated again: its score, and a recording for rerun."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kinemimic.evaluate.film.figures import humanoids
from kinemimic.evaluate.simulate.session.frame import Frame, Score
from kinemimic.evaluate.simulate.session.recording import Replay
from kinemimic.evaluate.view.command import how_to_open, write_recording
from kinemimic.evaluate.view.obstacle_rendering import Disturbances
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.retarget.formats.motion_json import MOTION, read_motion_json
from kinemimic.retarget.humanoid.body import FEET, node_offsets
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.rollout.trajectory import Trajectory
from kinemimic.train.scenario.scenario_file import find_scenario
from kinemimic.train.sim.world import Obstacle

REPLAY = "session.rrd"


def replay_session(folder: Path) -> dict[str, Any]:
    """Simulate a recorded session again, write session.rrd to its folder, and return its score.

    steps: control steps; people: the most that a live capture showed, None without one; score: of the last
    ten seconds, None if too short. KinemimicError for a damaged recording, and where a state or the score
    differs from the recorded one in any bit.
    """
    replay = Replay(folder, named=find_scenario)
    frames = list(replay)
    if not frames:
        raise KinemimicError(f"{folder}: expected a session with control steps, found none")
    # A session that a live capture drove has no motion.
    motion = read_motion_json(folder / MOTION) if (folder / MOTION).exists() else None
    write_replay(folder / REPLAY, frames, motion, replay.score)
    shown = [frame.shown for frame in frames if frame.shown is not None]
    return {
        "steps": len(frames),
        "people": max(one.people for one in shown) if shown else None,
        "score": None if replay.score is None else replay.score.to_json(),
    }


def replay_summary(folder: Path, found: Mapping[str, Any]) -> str:
    """What `replay_session` found, as lines of text."""
    return (
        f"{found['steps']} control steps, every state as recorded\n{_score_line(found)}\n"
        f"{folder / REPLAY} ({how_to_open(folder / REPLAY)})"
    )


def _score_line(found: Mapping[str, Any]) -> str:
    score = found["score"]
    if found["people"] == 0:
        return "nobody was followed"
    return "too short for a score" if score is None else str(Score.from_json(score))


def write_replay(path: Path, frames: Sequence[Frame], motion: Motion | None, score: Score | None) -> None:
    """Write the frames of a session, with pushes, obstacles and contacts, for rerun; atomically.

    motion: what was performed, None for a live capture.
    """
    trajectory = _trajectory(frames, motion)
    obstacles, states = obstacle_columns(frames)
    loads = np.array([frame.loads for frame in frames])
    text = f"A recorded session of {len(frames)} control steps; {score or 'too short for a score'}"
    write_recording(
        path,
        trajectory,
        humanoids(trajectory, 0, node_offsets() if motion is None else motion.offsets),
        text,
        disturbances=Disturbances(obstacles, states, loads),
    )


def obstacle_columns(frames: Sequence[Frame]) -> tuple[list[Obstacle], Array]:
    """The K obstacles of F frames, and their states (F, K, 13), NaN where one is not there.

    An obstacle that appears takes the place of one that has gone and looked like it: a person may throw the
    same ball a thousand times.
    """
    looks: list[Obstacle] = []
    places: list[dict[int, int]] = []  # by number, of each frame
    for frame in frames:
        before, here = places[-1] if places else {}, dict[int, int]()
        for number, obstacle in zip(frame.numbers, frame.obstacles, strict=True):
            if number in before:
                here[number] = before[number]
                continue
            taken = {*before.values(), *here.values()}
            free = (
                k
                for k, other in enumerate(looks)
                if k not in taken and (other.shape, other.size) == (obstacle.shape, obstacle.size)
            )
            here[number] = next(free, len(looks))
            if here[number] == len(looks):
                looks.append(obstacle)
        places.append(here)
    states = np.full((len(frames), len(looks), 13), np.nan)
    for row, frame, here in zip(states, frames, places, strict=True):
        for number, state in zip(frame.numbers, frame.states, strict=True):
            row[here[number]] = state
    return looks, states


def _trajectory(frames: Sequence[Frame], motion: Motion | None) -> Trajectory:
    """One rollout of all frames."""

    def column(name: str) -> Array:
        found: Array = np.array([getattr(frame, name) for frame in frames])[None]
        return found

    fell = [k for k, frame in enumerate(frames) if frame.fallen]
    contacts = column("contacts")
    return Trajectory(
        start_phases=np.zeros(1),
        phases=column("phase"),
        root=np.array([frame.bodies.positions[0] for frame in frames])[None],
        rotations=column("rotations"),
        reference_root=np.array([frame.target.positions[0] for frame in frames])[None],
        reference_rotations=column("reference_rotations"),
        rewards=np.array([list(frame.terms.values()) for frame in frames])[None],
        reward_names=np.array(list(frames[0].terms)),
        fallen_at=np.array([fell[0] if fell else len(frames)]),
        torques=np.zeros((1, len(frames), 14)),
        contacts=np.linalg.norm(contacts[:, :, FEET], axis=-1) > 0.0,
        contact_forces=contacts,
        motion="" if motion is None else motion.identity,
    )
