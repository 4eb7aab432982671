"""A replayed session as a rerun recording."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from kinemimic.evaluate.film.figures import humanoids
from kinemimic.evaluate.simulate.frame import Frame, Score
from kinemimic.evaluate.view.command import write_recording
from kinemimic.evaluate.view.obstacle_rendering import Disturbances
from kinemimic.pipeline.arrays import Array
from kinemimic.retarget.humanoid.body import BODY_INDEX, node_offsets
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.rollout.trajectory import Trajectory

_FEET = [BODY_INDEX["foot_left"], BODY_INDEX["foot_right"]]


def write_replay(path: Path, frames: Sequence[Frame], motion: Motion | None, score: Score | None) -> None:
    """Write the frames of a session, with pushes, obstacles and contacts, for rerun; atomically.

    motion: what was performed, None for a live capture.
    """
    trajectory = _trajectory(frames, motion)
    most = max(len(frame.obstacles) for frame in frames)
    # The humanoid's place among the obstacles is by number: a cleared and a new one share a shape.
    largest = max(frames, key=lambda frame: len(frame.obstacles)).obstacles
    states = np.full((len(frames), most, 13), np.nan)
    for k, frame in enumerate(frames):
        states[k, : len(frame.states)] = frame.states
    loads = np.array([frame.loads for frame in frames])
    text = f"A recorded session of {len(frames)} control steps; {score or 'too short for a score'}"
    write_recording(
        path,
        trajectory,
        humanoids(trajectory, 0, node_offsets() if motion is None else motion.offsets),
        text,
        disturbances=Disturbances(largest, states, loads),
    )


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
        contacts=np.linalg.norm(contacts[:, :, _FEET], axis=-1) > 0.0,
        contact_forces=contacts,
        motion="" if motion is None else motion.identity,
    )
