"""A trajectory as entities of a rerun recording: humanoids, ground and curves.

Two scenes show the same humanoids: `overlaid` in the same place, `beside` one ahead of the other. Each scene
has an entity `walker` that follows the simulated humanoid smoothly, as the origin of a view.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import rerun as rr

from kinemimic.evaluate.film.figures import COLORS, NAMES, REFERENCE, SIMULATED, Humanoid
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.angles import ANGLES
from kinemimic.pipeline.kinematics.skeleton import BONES, NODE_INDEX, NODES, SIDES
from kinemimic.retarget.humanoid.body import BODIES, BODY_INDEX, BODY_NODES
from kinemimic.retarget.humanoid.motion import joint_angles
from kinemimic.train.rollout.trajectory import Trajectory
from kinemimic.train.sim.world import CONTROL_RATE

TIMELINE = "time"
SCENES = ("overlaid", "beside")
APART = 1.1  # m between the humanoids of `beside`
GROUND_COLOR = (90, 90, 90)
SMOOTHING = 30  # frames over which a view's path is averaged, so that it does not sway with the hips


def log_scenes(stream: rr.RecordingStream, reference: Humanoid, simulated: Humanoid) -> None:
    """Log both scenes."""
    for scene in SCENES:
        log_scene(stream, scene, reference, simulated, solid=scene == "beside")


def log_scene(
    stream: rr.RecordingStream, scene: str, reference: Humanoid, simulated: Humanoid, *, solid: bool
) -> None:
    """Log the skeletons, bodies, ground and origin of the view of one scene.

    solid: whether the bodies of both are solid, or only wire frames of the simulated ones are shown.
    """
    stream.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, _classes(), static=True)
    times = time_columns(frame_times(len(simulated.positions)))
    ground = _grid(np.concatenate([reference.positions[:, 0], simulated.positions[:, 0]]))
    path = _smooth_path(simulated.positions[:, 0, :2])
    stream.log(f"{scene}/ground", ground, static=True)
    walker = rr.Transform3D.columns(translation=np.column_stack([path, np.zeros(len(path))]))
    stream.send_columns(f"{scene}/walker", times, walker)
    for humanoid in (reference, simulated):
        place = entity_path(scene, humanoid.kind)
        _log_skeleton(stream, f"{place}/skeleton", times, humanoid)
        if solid or humanoid.kind == SIMULATED:
            _log_bodies(stream, f"{place}/bodies", times, humanoid, solid=solid)


def entity_path(scene: str, kind: int) -> str:
    """The parent entity of a humanoid."""
    return f"{scene}/{NAMES[kind]}"


def place_side_by_side(stream: rr.RecordingStream, kinds: Sequence[int]) -> None:
    """In `beside`, place the humanoids of these kinds one ahead of the other, the first at the back."""
    for k, kind in enumerate(kinds):
        ahead = APART * (k - 0.5 * (len(kinds) - 1))
        stream.log(entity_path("beside", kind), rr.Transform3D(translation=(ahead, 0.0, 0.0)), static=True)


def log_curves(stream: rr.RecordingStream, trajectory: Trajectory, rollout: int) -> None:
    """Log knee and hip flexion (degrees), reward terms, torques (N·m) and ground reaction forces (N)."""
    times = time_columns(frame_times(trajectory.root.shape[1]))
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
    for side in SIDES:
        up = trajectory.contact_forces[rollout, :, BODY_INDEX[f"foot_{side}"], 2]
        _log_series(stream, f"ground/{side}", times, up, rr.SeriesLines(names=side))


def frame_times(frames: int) -> Array:
    """Times (F,) in seconds: frame f of a trajectory is the state after f + 1 control steps."""
    return np.arange(1, frames + 1) / CONTROL_RATE


def time_columns(seconds: Array) -> list[rr.TimeColumn]:
    """Both timelines at seconds (N,); a time between two frames belongs to the first."""
    frame = np.floor(seconds * CONTROL_RATE + 1e-6).astype(np.int64) - 1
    return [rr.TimeColumn(TIMELINE, duration=seconds), rr.TimeColumn("frame", sequence=frame)]


def _classes() -> rr.AnnotationContext:
    """Names, colours and bones of the skeletons, which are logged as points."""
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
    stream: rr.RecordingStream, place: str, times: Iterable[rr.TimeColumn], humanoid: Humanoid
) -> None:
    looks = rr.Points3D.from_fields(
        class_ids=[humanoid.kind], keypoint_ids=list(range(len(NODES))), radii=[0.018], show_labels=False
    )
    stream.log(place, looks, static=True)
    frames = len(humanoid.positions)
    columns = rr.Points3D.columns(positions=humanoid.positions.reshape(-1, 3).astype(np.float32))
    stream.send_columns(place, times, columns.partition([len(NODES)] * frames))


def _log_bodies(
    stream: rr.RecordingStream, place: str, times: Iterable[rr.TimeColumn], humanoid: Humanoid, *, solid: bool
) -> None:
    """Log the shapes of Table 1 once each, and the poses of their nodes over time."""
    fill = rr.components.FillMode.Solid if solid else rr.components.FillMode.MajorWireframe
    # The wire frame is dimmer than the skeleton inside it.
    color = tuple(channel if solid else channel * 3 // 5 for channel in COLORS[humanoid.kind])
    for body, node in zip(BODIES, BODY_NODES, strict=True):
        half = [0.5 * side for side in body.size]
        shape = rr.Boxes3D if body.shape == "box" else rr.Ellipsoids3D
        look = shape(half_sizes=[half], centers=[body.center], colors=[color], fill_mode=fill)
        stream.log(f"{place}/{body.name}", look, static=True)
        poses = rr.Transform3D.columns(
            translation=humanoid.positions[:, node].astype(np.float32),
            quaternion=humanoid.rotations[:, node].astype(np.float32),
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


def _grid(path: Array) -> rr.LineStrips3D:
    """Ground lines around a path (N, 3); the grid of a view would move along with its origin."""
    spacing, margin = 0.5, 3.0  # m
    low = np.floor((path.min(axis=0) - margin) / spacing) * spacing
    high = np.ceil((path.max(axis=0) + margin) / spacing) * spacing
    along = [[(x, low[1], 0.0), (x, high[1], 0.0)] for x in np.arange(low[0], high[0] + spacing / 2, spacing)]
    across = [
        [(low[0], y, 0.0), (high[0], y, 0.0)] for y in np.arange(low[1], high[1] + spacing / 2, spacing)
    ]
    return rr.LineStrips3D(along + across, colors=GROUND_COLOR, radii=0.003)


def _smooth_path(path: Array) -> Array:
    """A path (F, 2) averaged over SMOOTHING frames, extended by point reflection at its ends."""
    half = min(SMOOTHING // 2, len(path) - 1)
    longer = np.pad(path, ((half, half), (0, 0)), mode="reflect", reflect_type="odd")
    window = np.ones(2 * half + 1) / (2 * half + 1)
    return np.stack([np.convolve(axis, window, mode="valid") for axis in longer.T], axis=-1)
