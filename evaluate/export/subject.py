"""What can be exported: a capture, a reference or a simulated motion, in each form that a format asks for."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.convert import on_nodes
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import file_hash, read_clip
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rest_pose import node_rotations_of
from kinemimic.pipeline.quality.rules.frame_selection import select_frames
from kinemimic.pipeline.writers.poses import Poses, poses_of_clip
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.retarget.formats.poses import motion_of_poses, poses_of_motion
from kinemimic.retarget.formats.read_mcap import read_mcap, recover_mcap
from kinemimic.retarget.humanoid.motion import Motion, joint_angles
from kinemimic.train.rollout.trajectory import Trajectory
from kinemimic.train.sim.world import CONTROL_RATE

# The subjects of a run folder, and the file that each is made of.
SUBJECTS: dict[str, str] = {
    "capture": "quaternions.parquet",
    "reference": "motion.json",
    "simulated": "trajectory.npz",
}
# The rollout that began where the reference begins.
_ROLLOUT = 0
# Formats that hold frames as they were captured, at their own times and with their gaps.
_AS_CAPTURED = ("csv", "trc")
# Formats whose figures have bones of one length, which those that a sensor sees have not.
_RIGID = ("json", "mcap")


@dataclass(frozen=True)
class Subject:
    """One motion in the forms that writers take; each is made when a writer asks for it.

    clip: the frames as they are, with gaps and times of their own; poses: at an even rate without gaps;
    on_nodes: these of the 20 nodes; closed: the same with a cycle's first frame once more at its end;
    motion: these as a Motion; angles: knees and hips (T,) in radians on the clip's frames.
    """

    clip: Clip
    told: str
    inputs: Mapping[str, str]
    given: Motion | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def poses(self) -> Poses:
        return poses_of_motion(self.given) if self.given else poses_of_clip(self.clip)

    @cached_property
    def _nodes(self) -> Clip:
        return on_nodes(self.clip)

    @cached_property
    def on_nodes(self) -> Poses:
        if self.given:
            return self.poses
        # Turns that no position shows, of a head, a foot, a forearm, are kept where a recorder gave them.
        return poses_of_clip(replace(self._nodes, rotations=node_rotations_of(self.clip).rotations))

    @cached_property
    def closed(self) -> Poses:
        return poses_of_motion(self.given, closed=True) if self.given else self.on_nodes

    @cached_property
    def motion(self) -> Motion:
        return self.given or motion_of_poses(self.on_nodes)

    @cached_property
    def _off(self) -> float:
        """Mean distance (metres) of the motion's nodes from the captured ones."""
        apart = self.motion.kinematics()[0] - self.on_nodes.kinematics()[0]
        return float(np.linalg.norm(apart, axis=-1).mean())

    @cached_property
    def angles(self) -> Mapping[str, Array]:
        return joint_angles(self.given.rotations) if self.given else leg_angles(self._nodes.positions)

    def size(self, form: str) -> tuple[int, float]:
        """Frames and frames a second of the motion in that format."""
        if form in _AS_CAPTURED:
            return len(self.clip.times), self.clip.rate
        poses = self.closed if form == "deepmimic" else self.poses
        return len(poses.rotations), poses.rate

    @property
    def simulated(self) -> bool:
        """True if the capture behind it was made by the virtual Kinect."""
        return self.clip.simulated

    def note(self, form: str) -> str:
        """What is to be told of this motion in that format, besides its name."""
        notes = ["from a SIMULATED capture" if self.simulated else "", self.told]
        if self.given is None and form not in _AS_CAPTURED:
            if self.poses.filled:
                notes.append(f"{self.poses.filled} joint positions interpolated")
            if len(self.poses.rotations) != len(self.clip.times):
                notes.append("on an even clock")
            if form in _RIGID:
                notes.append(f"rigid bones, {1e3 * self._off:.0f} mm off on average")
        if form == "mcap" and self.motion.cyclic:
            notes.append("repeated for ten seconds")
        return "; ".join(note for note in notes if note)


def of_run(run: Path, wanted: Iterable[str] = (), number: int | None = None) -> dict[str, Subject]:
    """Subjects of a run folder by name; all that it holds where none are wanted by name.

    number: of the capture's pass, the longest by default. KinemimicError for what is not there.
    """
    if not run.is_dir():
        raise KinemimicError(f"{run}: expected a run folder, found none; name one with --run")
    names = list(wanted) or [name for name, file in SUBJECTS.items() if (run / file).is_file()]
    if not names:
        raise KinemimicError(
            f"{run}: expected {', '.join(SUBJECTS.values())}, found none; run `kinemimic run` first"
        )
    read: dict[str, Callable[[Path], Subject]] = {
        "capture": partial(_capture, number=number),
        "reference": _reference,
        "simulated": _simulated,
    }
    return {name: read[name](run) for name in names}


def _capture(run: Path, number: int | None) -> Subject:
    """The longest pass of the converted capture, or the one of that number."""
    path = run / "quaternions.parquet"
    clip = read_clip(path)
    there = np.unique(clip.passes[clip.passes >= 0])
    if number is None:
        counts = [int((clip.passes == one).sum()) for one in there]
        number = int(there[int(np.argmax(counts))]) if len(there) else 0
    if number not in there:
        passes = f"{len(there)} passes, counted from 0" if len(there) else "no pass with a person in it"
        raise KinemimicError(f"{path}: expected pass {number}, found {passes}")
    told = f"pass {number} of {len(there)}" if len(there) > 1 else ""
    return Subject(
        select_frames(clip, clip.passes == number),
        told,
        {"clip": file_hash(path)},
        provenance=clip.provenance,
    )


def _of_motion(motion: Motion, told: str, inputs: Mapping[str, str]) -> Subject:
    clip = replace(poses_of_motion(motion).clip(), provenance=motion.provenance)
    return Subject(clip, told, inputs, motion, motion.provenance)


def _reference(run: Path) -> Subject:
    motion = read_motion_json(run / "motion.json")
    return _of_motion(motion, "one cycle" if motion.cyclic else "", {"motion": motion.identity})


def _simulated(run: Path) -> Subject:
    """The rollout from the reference's start; its first frame is the state after one control step."""
    reference, path = read_motion_json(run / "motion.json"), run / "trajectory.npz"
    trajectory = Trajectory.load(path)
    fallen = int(trajectory.fallen_at[_ROLLOUT])
    motion = Motion(
        rate=CONTROL_RATE,
        root=trajectory.root[_ROLLOUT],
        rotations=trajectory.rotations[_ROLLOUT],
        contacts=trajectory.contacts[_ROLLOUT],
        cyclic=False,
        offsets=reference.offsets,
        provenance=reference.provenance,
    )
    told = f"falls at frame {fallen}" if fallen < len(motion.root) else ""
    inputs = {"motion": reference.identity, "trajectory": file_hash(path)}
    return _of_motion(motion, told, inputs)


def of_mcap(path: Path, *, recover: bool) -> Subject:
    """The motion in an MCAP of ours; recover: whatever is left of it."""
    if recover:
        found = recover_mcap(path)
        motion, told = found.motion, "the file is whole" if found.fault is None else f"found {found.fault}"
    else:
        motion, told = read_mcap(path), ""
    return _of_motion(motion, told, {"mcap": file_hash(path)})
