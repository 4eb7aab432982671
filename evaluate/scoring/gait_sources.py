"""The three walkers of a run: the captured person, the reference on the body, and the simulated figure.

All are brought to one form, so that one measurement serves all three: positions of the 20 nodes over time,
clinical angles, and, where rotations were measured, what the knees turn about other axes than their hinge.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.convert import on_nodes
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import read_clip
from kinemimic.pipeline.gait.events import SIDES
from kinemimic.pipeline.gait.knee_axis import about_own_axis, off_axis
from kinemimic.pipeline.gait.parameters import Gait, study_gait
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.clip import Clip, forward_kinematics
from kinemimic.pipeline.kinematics.nodes import joints_of_nodes, made_up
from kinemimic.pipeline.kinematics.orient import node_rotations
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, multiply, to_rotvec
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, node_skeleton
from kinemimic.retarget.formats.gait_json import read_gait_json
from kinemimic.retarget.humanoid.motion import Motion, joint_angles
from kinemimic.train.rollout.trajectory import Trajectory
from kinemimic.train.sim.world import CONTROL_RATE

_CYCLES = 6  # of a loop, walked on, so that whole strides begin and end within


@dataclass(frozen=True)
class Walker:
    """One who walks, T frames.

    times: (T,) seconds within each pass; passes: (T,) number of the pass, -1 for frames that do not count;
    gait: its strides; angles: curves (T,) in radians by name ("knee_left", …, and "ankle_left" where feet
    were measured); off_axis: (T,) radians by side; contacts: (T, 2) left, right foot touches the ground; each
    None where it is not known; notes: what must be said of them.
    """

    times: Array
    passes: NDArray[np.int32]
    gait: Gait
    angles: Mapping[str, Array]
    off_axis: Mapping[str, Array] | None
    contacts: NDArray[np.bool_] | None
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _Believed:
    """What `retarget` judged: pelvis, feet; trunk_lean, sole_pitch: radians forward and toes down."""

    pelvis: bool = True
    feet: bool = False
    trunk_lean: float = 0.0
    sole_pitch: float = 0.0


def captured(run: Path, motion: Motion | None = None) -> Walker | None:
    """The person of run/quaternions.parquet; None where there is no such file.

    What `retarget` found not to be believed (gait.json) is left out here too: a pelvis is then upright with
    the trunk's lean and looks where the person goes, and feet have no angle, as they have none before
    that judgement. Soles that it found to slope in stance are taken as flat, as there. KinemimicError where
    the run's motion was made of another recording: then so was the judgement.
    """
    if not (run / "quaternions.parquet").exists():
        return None
    source = read_clip(run / "quaternions.parquet")
    if motion is not None:
        _expect_same(run, source.provenance, motion.provenance.get("capture", {}))
    clip = on_nodes(source)
    believed = _believed(run / "gait.json")
    gait = study_gait(clip.times, clip.passes, clip.positions)
    notes = ["simulated: a virtual Kinect recorded it"] if source.simulated else []
    pelvis = None
    if not believed.pelvis:
        pelvis = _neutral_pelvis(clip, gait, believed.trunk_lean)
        notes.append("its pelvis is not repeatable and taken as upright: hips are relative to the heading")
    angles = leg_angles(clip.positions, pelvis)
    if believed.feet and not {"foot_left", "foot_right"} & set(made_up(source)):
        # Soles lie flat in stance; where they seem to slope, it is the sensor's or marker's idea of a toe.
        ankles = _ankles(node_rotations(clip.positions))
        angles |= {name: ankle + believed.sole_pitch for name, ankle in ankles.items()}
    else:
        notes.append("no ankle: its feet are not shown well enough, or retarget has not judged them yet")
    knees = _own_knees(run, source)
    if knees is None:
        notes.append("positions do not show how the knees turn about other axes than their hinge")
    return Walker(clip.times, clip.passes, gait, angles, knees, None, tuple(notes))


def _expect_same(run: Path, capture: Mapping[str, Any], motion: Mapping[str, Any]) -> None:
    """A later `ingest` into the same folder leaves the motion of the one before."""
    hashes = [made.get("sha256") for made in (capture, motion)]
    if None not in hashes and hashes[0] != hashes[1]:
        raise KinemimicError(
            f"{run}: expected capture and motion of one recording, found {capture.get('source')} and "
            f"{motion.get('source')}; run `retarget` again, or use a folder for each"
        )


def _believed(path: Path) -> _Believed:
    """From gait.json; the defaults where there is none, or one of a movement that is no gait."""
    if not path.exists():
        return _Believed()
    try:
        found = read_gait_json(path).get("reliability", {})
        lean, pitch = (
            float(np.radians(found.get(name) or 0.0)) for name in ("trunk_lean_deg", "planted_foot_pitch_deg")
        )
        return _Believed(bool(found.get("pelvis", True)), bool(found.get("feet", False)), lean, pitch)
    except (AttributeError, TypeError):
        raise KinemimicError(
            f"{path}: expected what `retarget` writes, found other JSON; run `retarget` again"
        ) from None


def reference(motion: Motion) -> Walker:
    """The motion that is to be performed; a loop is walked on for some cycles."""
    frames, cycles = len(motion.root), _CYCLES if motion.cyclic else 1
    positions = motion.kinematics()[0]
    turns = np.repeat(np.arange(cycles), frames)
    walked = np.tile(positions, (cycles, 1, 1)) + (turns[:, None] * motion.cycle_offset)[:, None]
    return _on_body(
        np.arange(cycles * frames) / motion.rate,
        np.zeros(cycles * frames, dtype=np.int32),
        walked,
        np.tile(motion.rotations, (cycles, 1, 1)),
        # A motion's contacts are of feet that lie flat and still: no stance.
        None,
    )


def simulated(trajectory: Trajectory, motion: Motion) -> Walker:
    """The figure in all its rollouts, each up to its fall."""
    rollouts, frames = trajectory.root.shape[:2]
    times = np.tile((np.arange(frames) + 1) / CONTROL_RATE, rollouts)
    upright = np.arange(frames) < trajectory.fallen_at[:, None]
    passes = np.where(upright, np.arange(rollouts)[:, None], -1).astype(np.int32).ravel()
    rotations = trajectory.rotations.reshape(rollouts * frames, *trajectory.rotations.shape[2:])
    translations = np.broadcast_to(motion.offsets, (len(rotations), *motion.offsets.shape)).copy()
    translations[:, 0] = trajectory.root.reshape(-1, 3)
    positions = forward_kinematics(node_skeleton(motion.offsets), translations, rotations)[0]
    return _on_body(times, passes, positions, rotations, trajectory.contacts.reshape(-1, 2))


def _on_body(
    times: Array,
    passes: NDArray[np.int32],
    positions: Array,
    rotations: Array,
    contacts: NDArray[np.bool_] | None,
) -> Walker:
    knees = {side: off_axis(rotations[:, NODE_INDEX[f"knee_{side}"]]) for side in SIDES}
    angles = joint_angles(rotations) | _ankles(rotations)
    return Walker(times, passes, study_gait(times, passes, positions), angles, knees, contacts, ())


def _ankles(rotations: Array) -> dict[str, Array]:
    """Toes up is positive: a turn about +Y takes them down."""
    return {f"ankle_{side}": -to_rotvec(rotations[:, NODE_INDEX[f"ankle_{side}"]])[:, 1] for side in SIDES}


def _neutral_pelvis(clip: Clip, gait: Gait, lean: float) -> Array:
    """World frames (T, 4) that look along the path and lean; NaN in passes without a gait."""
    frames = np.full((len(clip.times), 4), np.nan)
    for number, feet in gait.feet.items():
        mine = clip.passes == number
        x, y = (np.interp(clip.times[mine], feet.times, feet.forward[:, k]) for k in range(2))
        frames[mine] = multiply(from_axis_angle("Z", np.arctan2(y, x)), from_axis_angle("Y", lean))
    return frames


def _own_knees(run: Path, source: Clip) -> dict[str, Array] | None:
    """Off-axis turn of the knees in a capture of rotations; None where it holds positions alone."""
    recorded = read_clip(run / "clip.parquet")
    joints = joints_of_nodes(source.skeleton.names)
    if source.rotations is None or (recorded.rotations is None and recorded.euler is None):
        return None
    knees: dict[str, Array] = {}
    for side in SIDES:
        knee, hip = joints[f"knee_{side}"], joints[f"hip_{side}"]
        turn, joint = source.rotations[:, knee], source.skeleton.parents[knee]
        # A twist joint may lie between.
        while joint not in (hip, -1):
            turn, joint = multiply(source.rotations[:, joint], turn), source.skeleton.parents[joint]
        swing = about_own_axis(turn) if joint == hip else None
        if swing is None:
            return None
        knees[side] = swing
    return knees
