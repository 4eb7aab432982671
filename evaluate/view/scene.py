"""What a playback looks like: figures, ground and curves as entities of a rerun recording.

Two scenes hold the same figures: `overlaid` puts all on the reference, `beside` one ahead of the other.
Each has a `walker` that glides along with the simulated figure, for a view to take its place.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.angles import ANGLES
from kinemimic.pipeline.kinematics.clip import forward_kinematics
from kinemimic.pipeline.kinematics.skeleton import BONES, NODE_INDEX, NODES, node_skeleton
from kinemimic.retarget.humanoid.body import BODIES, BODY_INDEX, BODY_NODES
from kinemimic.retarget.humanoid.motion import joint_angles
from kinemimic.train.rollout.trajectory import Trajectory
from kinemimic.train.sim.world import CONTROL_RATE

TIMELINE = "time"
SCENES = ("overlaid", "beside")
APART = 1.1  # m from one figure of `beside` to the next
REFERENCE, SIMULATED, CAPTURED = 1, 2, 3  # class ids
COLORS = {REFERENCE: (120, 190, 255), SIMULATED: (255, 150, 50), CAPTURED: (170, 170, 170)}
NAMES = {REFERENCE: "reference", SIMULATED: "simulated", CAPTURED: "captured"}
GROUND_COLOR = (90, 90, 90)
FEET = ("left", "right")
GLIDE = 30  # frames over which the walker's path is averaged, so that a view does not sway with the hips


@dataclass(frozen=True)
class Figure:
    """One figure through a rollout: positions (F, 20, 3), rotations (F, 20, 4) of the nodes in the world."""

    kind: int
    positions: Array
    rotations: Array


def figures(trajectory: Trajectory, rollout: int, offsets: Array) -> tuple[Figure, Figure]:
    """Reference and simulated figure of one rollout; offsets: (20, 3) of the nodes from their parents."""

    def figure(kind: int, root: Array, rotations: Array) -> Figure:
        translations = np.broadcast_to(offsets, (len(root), *offsets.shape)).copy()
        translations[:, 0] = root
        return Figure(kind, *forward_kinematics(node_skeleton(offsets), translations, rotations))

    return (
        figure(REFERENCE, trajectory.reference_root[rollout], trajectory.reference_rotations[rollout]),
        figure(SIMULATED, trajectory.root[rollout], trajectory.rotations[rollout]),
    )


def log_scenes(stream: rr.RecordingStream, reference: Figure, simulated: Figure) -> None:
    """Both scenes: skeletons, bodies, ground, walker."""
    stream.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, _classes(), static=True)
    times = moments(clock(len(simulated.positions)))
    ground = _grid(np.concatenate([reference.positions[:, 0], simulated.positions[:, 0]]))
    path = _glide(simulated.positions[:, 0, :2])
    for scene in SCENES:
        stream.log(f"{scene}/ground", ground, static=True)
        walker = rr.Transform3D.columns(translation=np.column_stack([path, np.zeros(len(path))]))
        stream.send_columns(f"{scene}/walker", times, walker)
        for figure in (reference, simulated):
            place = place_of(scene, figure.kind)
            _log_skeleton(stream, f"{place}/skeleton", times, figure)
            if scene == "beside" or figure.kind == SIMULATED:
                _log_bodies(stream, f"{place}/bodies", times, figure, solid=scene == "beside")


def place_of(scene: str, kind: int) -> str:
    """The entity that holds all of a figure."""
    return f"{scene}/{NAMES[kind]}"


def set_apart(stream: rr.RecordingStream, kinds: Sequence[int]) -> None:
    """In `beside`, the figures of these kinds one ahead of the other, the first behind."""
    for k, kind in enumerate(kinds):
        ahead = APART * (k - 0.5 * (len(kinds) - 1))
        stream.log(place_of("beside", kind), rr.Transform3D(translation=(ahead, 0.0, 0.0)), static=True)


def log_curves(stream: rr.RecordingStream, trajectory: Trajectory, rollout: int) -> None:
    """Knee and hip flexion in degrees, reward terms, torques in N·m, the ground's push on each foot in N."""
    times = moments(clock(trajectory.root.shape[1]))
    for kind, rotations in (
        (REFERENCE, trajectory.reference_rotations[rollout]),
        (SIMULATED, trajectory.rotations[rollout]),
    ):
        curves = joint_angles(rotations)
        for angle in ANGLES:
            line = rr.SeriesLines(colors=COLORS[kind], names=NAMES[kind], widths=2.0)
            _log_series(stream, f"angles/{angle}/{NAMES[kind]}", times, np.degrees(curves[angle]), line)
    for k, name in enumerate(trajectory.reward_names.tolist()):
        _log_series(
            stream, f"reward/{name}", times, trajectory.rewards[rollout, :, k], rr.SeriesLines(names=name)
        )
    for k, body in enumerate(BODIES[1:]):
        line = rr.SeriesLines(names=body.name)
        _log_series(stream, f"torque/{body.name}", times, trajectory.torques[rollout, :, k], line)
    for side in FEET:
        up = trajectory.contact_forces[rollout, :, BODY_INDEX[f"foot_{side}"], 2]
        _log_series(stream, f"ground/{side}", times, up, rr.SeriesLines(names=side))


def clock(frames: int) -> Array:
    """Seconds (F,) of frames of a playback: frame f is the state after f + 1 control steps."""
    return np.arange(1, frames + 1) / CONTROL_RATE


def moments(seconds: Array) -> list[rr.TimeColumn]:
    """Both timelines at seconds (N,) of the recording: a moment between two frames belongs to the first."""
    frame = np.floor(seconds * CONTROL_RATE + 1e-6).astype(np.int64) - 1
    return [rr.TimeColumn(TIMELINE, duration=seconds), rr.TimeColumn("frame", sequence=frame)]


def _classes() -> rr.AnnotationContext:
    """Names, colours and bones of both figures: with them, points are drawn as skeletons."""
    bones = [(NODE_INDEX[a], NODE_INDEX[b]) for a, b in BONES]
    return rr.AnnotationContext(
        [
            rr.ClassDescription(
                info=rr.AnnotationInfo(id=kind, label=NAMES[kind], color=COLORS[kind]),
                keypoint_annotations=[
                    rr.AnnotationInfo(id=index, label=node, color=COLORS[kind])
                    for index, node in enumerate(NODES)
                ],
                keypoint_connections=bones,
            )
            for kind in NAMES
        ]
    )


def _log_skeleton(
    stream: rr.RecordingStream, place: str, times: Iterable[rr.TimeColumn], figure: Figure
) -> None:
    looks = rr.Points3D.from_fields(
        class_ids=[figure.kind], keypoint_ids=list(range(len(NODES))), radii=[0.018], show_labels=False
    )
    stream.log(place, looks, static=True)
    frames = len(figure.positions)
    columns = rr.Points3D.columns(positions=figure.positions.reshape(-1, 3).astype(np.float32))
    stream.send_columns(place, times, columns.partition([len(NODES)] * frames))


def _log_bodies(
    stream: rr.RecordingStream, place: str, times: Iterable[rr.TimeColumn], figure: Figure, *, solid: bool
) -> None:
    """Table 1's shapes, each once, carried by the node that they hang from."""
    fill = rr.components.FillMode.Solid if solid else rr.components.FillMode.MajorWireframe
    # A wire frame is dimmer than the skeleton that is seen through it.
    color = tuple(channel if solid else channel * 3 // 5 for channel in COLORS[figure.kind])
    for body, node in zip(BODIES, BODY_NODES, strict=True):
        half = [0.5 * side for side in body.size]
        shape = rr.Boxes3D if body.shape == "box" else rr.Ellipsoids3D
        look = shape(half_sizes=[half], centers=[body.center], colors=[color], fill_mode=fill)
        stream.log(f"{place}/{body.name}", look, static=True)
        poses = rr.Transform3D.columns(
            translation=figure.positions[:, node].astype(np.float32),
            quaternion=figure.rotations[:, node].astype(np.float32),
        )
        stream.send_columns(f"{place}/{body.name}", times, poses)


def _log_series(
    stream: rr.RecordingStream,
    place: str,
    times: Iterable[rr.TimeColumn],
    values: Array,
    line: rr.SeriesLines,
) -> None:
    stream.log(place, line, static=True)
    stream.send_columns(place, times, rr.Scalars.columns(scalars=values))


def _grid(path: Array, spacing: float = 0.5, margin: float = 3.0) -> rr.LineStrips3D:
    """Ground lines around a path (N, 3). A view's own grid would glide along with its walker."""
    low = np.floor((path.min(axis=0) - margin) / spacing) * spacing
    high = np.ceil((path.max(axis=0) + margin) / spacing) * spacing
    along = [[(x, low[1], 0.0), (x, high[1], 0.0)] for x in np.arange(low[0], high[0] + spacing / 2, spacing)]
    across = [
        [(low[0], y, 0.0), (high[0], y, 0.0)] for y in np.arange(low[1], high[1] + spacing / 2, spacing)
    ]
    return rr.LineStrips3D(along + across, colors=GROUND_COLOR, radii=0.003)


def _glide(path: Array) -> Array:
    """A path (F, 2) averaged over GLIDE frames; at the ends it goes on as it came."""
    half = min(GLIDE // 2, len(path) - 1)
    longer = np.pad(path, ((half, half), (0, 0)), mode="reflect", reflect_type="odd")
    window = np.ones(2 * half + 1) / (2 * half + 1)
    return np.stack([np.convolve(axis, window, mode="valid") for axis in longer.T], axis=-1)
