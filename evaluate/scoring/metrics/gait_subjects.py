"""The three subjects of a run's gait report: captured person, reference motion and simulated humanoid.

All have one form, so that the same measurement applies: positions of the 20 nodes over time, clinical joint
angles and, if rotations were measured, the knees' rotation about axes other than their hinge.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.convert import on_nodes, read_converted
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import read_clip
from kinemimic.pipeline.gait.knee_axis import off_axis, off_axis_of_fitted_hinge
from kinemimic.pipeline.gait.parameters import Gait, measure_gait
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.joint_names import joints_by_name
from kinemimic.pipeline.kinematics.nodes import derived_nodes, shows_feet
from kinemimic.pipeline.kinematics.orientation.from_positions import node_rotations
from kinemimic.pipeline.kinematics.rotations import conjugate, from_axis_angle, multiply, to_rotvec
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, SIDES
from kinemimic.pipeline.plural import plural
from kinemimic.retarget.formats.gait_json import read_gait_json
from kinemimic.retarget.humanoid.motion import Motion, joint_angles, node_kinematics
from kinemimic.train.rollout.trajectory import Trajectory
from kinemimic.train.sim.world import CONTROL_RATE

_CYCLES = 6  # repetitions of a loop, so that it contains full strides


@dataclass(frozen=True)
class GaitSubject:
    """T frames of a subject's gait.

    times: (T,) seconds within each pass; passes: (T,) number of the pass, -1 for excluded frames; gait: the
    strides; angles: curves (T,) in radians by name ("knee_left", …, and "ankle_left" if feet were measured);
    off_axis: (T,) radians by side that shows it, or None; contacts: (T, 2) contact of left and right foot, or
    None; notes: remarks for the report.
    """

    times: Array
    passes: NDArray[np.int32]
    gait: Gait
    angles: Mapping[str, Array]
    off_axis: Mapping[str, Array] | None
    contacts: NDArray[np.bool_] | None
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _Reliability:
    """Judgement by `retarget`: whether pelvis and feet are reliable; pelvis_pitch, sole_pitch: radians,
    forward and toes down."""

    pelvis: bool = True
    feet: bool = False
    pelvis_pitch: float = 0.0
    sole_pitch: float = 0.0


def captured(run: Path, motion: Motion | None = None) -> GaitSubject | None:
    """The person of run/quaternions.parquet; None if there is no such file.

    Segments that `retarget` judged unreliable (gait.json) are excluded here too: the pelvis is then upright,
    with the trunk's lean and facing the direction of travel, and ankles have no angle. Before that judgement,
    they do not have one either. Soles that slope in stance are taken as flat, as in `retarget`.
    KinemimicError if the run's motion, and hence the judgement, comes from another recording.
    """
    if not (run / "quaternions.parquet").exists():
        return None
    source = read_converted(run)
    if motion is not None:
        _expect_same(run, source.provenance, motion.provenance.get("capture", {}))
    clip = on_nodes(source)
    reliable = _read_reliability(run / "gait.json")
    gait = measure_gait(clip.times, clip.passes, clip.positions, toes=shows_feet(clip.states))
    notes = ["simulated capture (virtual Kinect)"] if source.simulated else []
    if gait.backward:
        notes.append(f"{plural(gait.backward, 'bout')} of walking backward left out")
    pelvis = None
    if not reliable.pelvis:
        pelvis = _neutral_pelvis(clip, gait, reliable.pelvis_pitch)
        notes.append("pelvis not repeatable and taken as upright: hip angles are relative to the heading")
    angles = leg_angles(clip.positions, pelvis, times=clip.times)
    if reliable.feet and not {"foot_left", "foot_right"} & set(derived_nodes(source)):
        # Soles are flat in stance; an apparent slope is due to where the sensor or marker set has the toe.
        ankles = _ankles(node_rotations(clip.positions))
        angles |= {name: ankle + reliable.sole_pitch for name, ankle in ankles.items()}
    else:
        notes.append("no ankle angles: feet not captured reliably, or retarget has not been run")
    knees, unknown = _own_knees(run, source)
    notes += unknown
    return GaitSubject(clip.times, clip.passes, gait, angles, knees, None, tuple(notes))


def _expect_same(run: Path, capture: Mapping[str, Any], motion: Mapping[str, Any]) -> None:
    """A later `ingest` into the same folder leaves the earlier motion in place."""
    hashes = [made.get("sha256") for made in (capture, motion)]
    if None not in hashes and hashes[0] != hashes[1]:
        raise KinemimicError(
            f"{run}: expected capture and motion from the same recording, found {capture.get('source')} and "
            f"{motion.get('source')}; run `retarget` again, or use a folder for each"
        )


def _read_reliability(path: Path) -> _Reliability:
    """From gait.json; defaults if there is none, or if the movement is not a gait."""
    if not path.exists():
        return _Reliability()
    try:
        found = read_gait_json(path).get("reliability", {})
        # Earlier versions gave the pelvis the trunk's lean.
        pelvis = found.get("pelvis_pitch_deg", found.get("trunk_lean_deg"))
        lean, pitch = (
            float(np.radians(value or 0.0)) for value in (pelvis, found.get("planted_foot_pitch_deg"))
        )
        return _Reliability(bool(found.get("pelvis", True)), bool(found.get("feet", False)), lean, pitch)
    except (AttributeError, TypeError):
        raise KinemimicError(
            f"{path}: expected the report of `retarget`, found other JSON; run `retarget` again"
        ) from None


def reference(motion: Motion) -> GaitSubject:
    """The reference motion; a loop is repeated for some cycles."""
    frames, cycles = len(motion.root), _CYCLES if motion.cyclic else 1
    positions = motion.kinematics()[0]
    turns = np.repeat(np.arange(cycles), frames)
    walked = np.tile(positions, (cycles, 1, 1)) + (turns[:, None] * motion.cycle_offset)[:, None]
    return _on_body(
        np.arange(cycles * frames) / motion.rate,
        np.zeros(cycles * frames, dtype=np.int32),
        walked,
        np.tile(motion.rotations, (cycles, 1, 1)),
        # A motion's contacts mark feet that lie flat and still, which is not the stance phase.
        None,
    )


def strike_phases(motion: Motion) -> dict[str, float] | None:
    """Side -> phase of a loop at which its foot strikes; None if one of them does not."""
    feet = reference(motion).gait.feet.get(0)
    if feet is None or not all(len(feet.strikes[k]) for k in range(2)):
        return None
    return {side: float(feet.strikes[k][0] / motion.duration % 1.0) for k, side in enumerate(SIDES)}


def simulated(trajectory: Trajectory, motion: Motion) -> GaitSubject:
    """The humanoid in all its rollouts, each up to its fall."""
    rollouts, frames = trajectory.root.shape[:2]
    times = np.tile((np.arange(frames) + 1) / CONTROL_RATE, rollouts)
    upright = np.arange(frames) < trajectory.fallen_at[:, None]
    passes = np.where(upright, np.arange(rollouts)[:, None], -1).astype(np.int32).ravel()
    rotations = trajectory.rotations.reshape(rollouts * frames, *trajectory.rotations.shape[2:])
    positions, _ = node_kinematics(trajectory.root.reshape(-1, 3), rotations, motion.offsets)
    return _on_body(times, passes, positions, rotations, trajectory.contacts.reshape(-1, 2))


def _on_body(
    times: Array,
    passes: NDArray[np.int32],
    positions: Array,
    rotations: Array,
    contacts: NDArray[np.bool_] | None,
) -> GaitSubject:
    knees = {side: off_axis(rotations[:, NODE_INDEX[f"knee_{side}"]]) for side in SIDES}
    angles = joint_angles(rotations) | _ankles(rotations)
    return GaitSubject(times, passes, measure_gait(times, passes, positions), angles, knees, contacts, ())


def _ankles(rotations: Array) -> dict[str, Array]:
    """Ankle angles (T,) in radians; dorsiflexion is positive (a rotation about +Y lowers the toes)."""
    return {f"ankle_{side}": -to_rotvec(rotations[:, NODE_INDEX[f"ankle_{side}"]])[:, 1] for side in SIDES}


def _neutral_pelvis(clip: Clip, gait: Gait, lean: float) -> Array:
    """World rotations (T, 4) along the heading with that lean; NaN outside bouts."""
    frames = np.full((len(clip.times), 4), np.nan)
    for bout in gait.bouts.values():
        frames[bout.frames] = multiply(conjugate(bout.turn), from_axis_angle("Y", lean))
    return frames


def _own_knees(run: Path, source: Clip) -> tuple[dict[str, Array] | None, list[str]]:
    """Off-axis rotation (T,) by side, without a side that does not show it (None if neither does), and notes
    that say why."""
    missing = "off-axis knee rotation is unknown:"
    recorded = read_clip(run / "clip.parquet")
    joints = joints_by_name(source.skeleton.names)
    if source.rotations is None or (recorded.rotations is None and recorded.euler is None):
        return None, [f"{missing} the capture holds positions only"]
    knees: dict[str, Array] = {}
    notes = []
    for side in SIDES:
        knee, hip = joints[f"knee_{side}"], joints[f"hip_{side}"]
        turn, joint = source.rotations[:, knee], source.skeleton.parents[knee]
        # There may be a twist joint in between.
        while joint not in (hip, -1):
            turn, joint = multiply(source.rotations[:, joint], turn), source.skeleton.parents[joint]
        swing = off_axis_of_fitted_hinge(turn) if joint == hip else None
        if swing is not None:
            knees[side] = swing
        elif joint == hip:
            notes.append(f"{missing} the {side} knee hardly bends, so the axis of its hinge does not show")
        else:
            notes.append(f"{missing} the {side} knee does not hang from the hip")
    return knees or None, notes
