"""Motions that can be exported (capture, reference, simulated), in each form that a format requires."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.convert import on_nodes, read_converted
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.sidecars import note_path, read_note
from kinemimic.pipeline.files.store import file_hash
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.orientation.rest_pose import node_rotations_of
from kinemimic.pipeline.kinematics.rotations import continuous
from kinemimic.pipeline.plural import plural
from kinemimic.pipeline.quality.rules.frame_selection import select_frames
from kinemimic.pipeline.writers.poses import Poses, poses_of_clip
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.retarget.formats.poses import motion_of_poses, poses_of_motion
from kinemimic.retarget.formats.read_mcap import read_mcap, recover_mcap
from kinemimic.retarget.humanoid.motion import Motion, joint_angles
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.trajectory import Trajectory
from kinemimic.train.sim.world import CONTROL_RATE

# The subjects of a run folder, and the file that each is made of.
SOURCES: dict[str, str] = {
    "capture": "quaternions.parquet",
    "reference": "motion.json",
    "simulated": "trajectory.npz",
}
# The rollout that began where the reference begins.
_ROLLOUT = 0
# Formats that hold frames as they were captured, at their own times and with their gaps.
_AS_CAPTURED = ("csv", "trc")
# Formats whose skeletons have bones of constant length, unlike those from a sensor.
_RIGID = ("json", "mcap")


@dataclass(frozen=True)
class MotionSource:
    """One motion in the forms that writers take, each computed on demand.

    clip: the original frames with their gaps and times, from 0; poses: at a constant rate without gaps;
    on_nodes: the same for the 20 nodes; with_closing_frame: also with a cycle's first frame repeated at its
    end; motion: as a Motion; angles: knee and hip angles (T,) in radians on the clip's frames. starts_at: the
    first frame's time in seconds in the capture, or in the motion that a rollout follows.
    """

    clip: Clip
    remark: str
    inputs: Mapping[str, str]
    own_motion: Motion | None = None
    starts_at: float = 0.0
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def poses(self) -> Poses:
        return poses_of_motion(self.own_motion) if self.own_motion else poses_of_clip(self.clip)

    @cached_property
    def _nodes(self) -> Clip:
        return on_nodes(self.clip)

    @cached_property
    def on_nodes(self) -> Poses:
        if self.own_motion:
            return self.poses
        # Rotations that positions do not determine (head, feet, forearms) are kept if they were recorded.
        return poses_of_clip(replace(self._nodes, rotations=self._rotations))

    @cached_property
    def _rotations(self) -> Array:
        return node_rotations_of(self.clip).rotations

    @cached_property
    def with_closing_frame(self) -> Poses:
        return poses_of_motion(self.own_motion, closed=True) if self.own_motion else self.on_nodes

    @cached_property
    def motion(self) -> Motion:
        return self.own_motion or motion_of_poses(self.on_nodes)

    @cached_property
    def _rigid_error(self) -> float:
        """Mean distance in metres between the motion's nodes and the captured ones."""
        apart = self.motion.kinematics()[0] - self.on_nodes.kinematics()[0]
        return float(np.linalg.norm(apart, axis=-1).mean())

    @cached_property
    def angles(self) -> Mapping[str, Array]:
        if self.own_motion:
            return joint_angles(self.own_motion.rotations)
        # Hips are relative to the same pelvis as in the formats of poses, which may be a recorded one.
        return leg_angles(self._nodes.positions, self._rotations[:, 0], times=self.clip.times)

    def size(self, form: str) -> tuple[int, float]:
        """Number of frames and frame rate (Hz) in a format."""
        if form in _AS_CAPTURED:
            return len(self.clip.times), self.clip.rate
        poses = self.with_closing_frame if form == "deepmimic" else self.poses
        return len(poses.rotations), poses.rate

    @property
    def simulated(self) -> bool:
        """Whether the motion comes from a capture of the virtual Kinect."""
        return self.clip.simulated

    def note(self, form: str) -> str:
        """Remarks on this motion in a format."""
        notes = ["from a SIMULATED capture" if self.simulated else "", self.remark]
        if self.own_motion is None and form not in _AS_CAPTURED:
            if self.poses.filled:
                notes.append(f"{self.poses.filled} joint positions interpolated")
            if len(self.poses.rotations) != len(self.clip.times):
                notes.append("resampled to a constant rate")
            if form in _RIGID:
                notes.append(f"rigid bones, {1e3 * self._rigid_error:.0f} mm off on average")
        if form == "mcap" and self.motion.cyclic:
            notes.append("repeated for 10 s")
        return "; ".join(note for note in notes if note)


def sources_of_run(
    run: Path, wanted: Iterable[str] = (), number: int | None = None
) -> dict[str, MotionSource]:
    """Motions of a run folder by name; all of them by default.

    number: pass of the capture, by default the longest. KinemimicError for a missing motion or pass.
    """
    if not run.is_dir():
        raise KinemimicError(f"{run}: expected a run folder, found none; choose one with --run")
    names = list(wanted) or [name for name, file in SOURCES.items() if (run / file).is_file()]
    if not names:
        raise KinemimicError(
            f"{run}: expected {', '.join(SOURCES.values())}, found none; run `kinemimic run` first"
        )
    read: dict[str, Callable[[Path], MotionSource]] = {
        "capture": partial(_capture, number=number),
        "reference": _reference,
        "simulated": _simulated,
    }
    return {name: read[name](run) for name in names}


def _capture(run: Path, number: int | None) -> MotionSource:
    """The longest pass of the converted capture, or the pass of that number."""
    path = run / "quaternions.parquet"
    clip = read_converted(run)
    there = np.unique(clip.passes[clip.passes >= 0])
    if number is None:
        counts = [int((clip.passes == one).sum()) for one in there]
        number = int(there[int(np.argmax(counts))]) if len(there) else 0
    if number not in there:
        passes = (
            f"{plural(len(there), 'pass', 'passes')}, counted from 0"
            if len(there)
            else "no pass with a person in it"
        )
        raise KinemimicError(f"{path}: expected pass {number}, found {passes}")
    remark = f"pass {number} of {len(there)}" if len(there) > 1 else ""
    shown = select_frames(clip, clip.passes == number)
    start = float(shown.times[0])
    return MotionSource(
        replace(shown, times=shown.times - start),
        remark,
        {"clip": file_hash(path)},
        starts_at=start,
        provenance=clip.provenance,
    )


def _of_motion(motion: Motion, remark: str, inputs: Mapping[str, str], start: float = 0.0) -> MotionSource:
    clip = replace(poses_of_motion(motion).clip(), provenance=motion.provenance)
    return MotionSource(clip, remark, inputs, motion, start, motion.provenance)


def _reference(run: Path) -> MotionSource:
    motion = read_motion_json(run / "motion.json")
    return _of_motion(motion, "one cycle" if motion.cyclic else "", {"motion": motion.identity})


def _simulated(run: Path) -> MotionSource:
    """The rollout from phase 0."""
    reference, path = read_motion_json(run / "motion.json"), run / "trajectory.npz"
    trajectory = Trajectory.load(path, reference)
    motion, _ = figures_of(trajectory, reference)
    inputs = {"motion": reference.identity, "trajectory": file_hash(path)}
    start = float(trajectory.start_phases[_ROLLOUT]) * reference.duration
    return _of_motion(motion, fall_of(trajectory), inputs, start)


def figures_of(trajectory: Trajectory, motion: Motion) -> tuple[Motion, Motion]:
    """The humanoid and its reference in the rollout from phase 0; motion: the one that it follows.

    Frame f is f control steps after the start. A trajectory has no frame 0: there the humanoid is placed in
    the reference's pose, with the contacts of a step later.
    """
    reference, start = Reference(motion), trajectory.start_phases[[_ROLLOUT]]
    root, rotations = reference.root(start), reference.nodes(start)
    touching = trajectory.contacts[_ROLLOUT]

    def figure(roots: Array, turns: Array) -> Motion:
        return Motion(
            rate=CONTROL_RATE,
            root=np.concatenate([root, roots[_ROLLOUT]]),
            rotations=continuous(np.concatenate([rotations, turns[_ROLLOUT]])),
            contacts=np.concatenate([touching[:1], touching]),
            cyclic=False,
            offsets=motion.offsets,
            provenance=motion.provenance,
        )

    return (
        figure(trajectory.root, trajectory.rotations),
        figure(trajectory.reference_root, trajectory.reference_rotations),
    )


def fall_of(trajectory: Trajectory) -> str:
    """A remark on the fall in the rollout from phase 0, empty without one."""
    fallen = int(trajectory.fallen_at[_ROLLOUT])
    at = (fallen + 1) / CONTROL_RATE
    return f"falls at {at:.2f} s" if fallen < trajectory.root.shape[1] else ""


def source_of_mcap(path: Path, *, recover: bool) -> MotionSource:
    """The motion in an MCAP file of kinemimic, simulated if its sidecar file says so; recover: its intact
    part."""
    if recover:
        found = recover_mcap(path)
        motion = found.motion
        remark = "the file is complete" if found.fault is None else f"found {found.fault}"
    else:
        motion, remark = read_mcap(path), ""
    if read_note(note_path(path)).get("simulated"):
        # A rollout follows a motion that need not be simulated.
        motion = replace(motion, provenance={**motion.provenance, "simulated": True})
    return _of_motion(motion, remark, {"mcap": file_hash(path)})
