"""Several moving figures in one MCAP, for Foxglove and rerun."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.CubePrimitive_pb2 import CubePrimitive
from foxglove_schemas_protobuf.CylinderPrimitive_pb2 import CylinderPrimitive
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.SpherePrimitive_pb2 import SpherePrimitive
from mcap.writer import CompressionType, Writer
from mcap_protobuf.schema import register_schema

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.files.store import atomic
from kinemimic.pipeline.kinematics.rotations import IDENTITY
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODE_PARENTS, NODES
from kinemimic.retarget.formats.gltf import Figure
from kinemimic.retarget.formats.write_mcap import (
    CHUNK_BYTES,
    JOINT_STATE,
    METADATA_NAME,
    NODE_FRAMES,
    START_NS,
    WORLD_FRAME,
    joint_state_messages,
    skeleton_messages,
    stamp,
    transform,
)
from kinemimic.retarget.humanoid.body import BODIES, Body


def write_mcap_figures(path: Path, figures: Sequence[Figure], metadata: Mapping[str, Any]) -> None:
    """Write figures of one frame rate and length as MCAP (zstd), deterministically and atomically.

    /tf                 foxglove.FrameTransforms: world to FIGURE/pelvis, and every body and end node
                        FIGURE/NAME to its parent
    /scene              foxglove.SceneUpdate: the bodies, each in its own frame, once at the start
    /FIGURE/skeleton    foxglove.PointCloud: the 20 nodes in the world
    /FIGURE/joint_states sensor_msgs/JointState: knee and hip flexion, radians and radians a second
    and a metadata record "kinemimic" with JSON values. ValueError if rates or lengths differ.
    """
    first = figures[0].motion
    if any((f.motion.rate, len(f.motion.root)) != (first.rate, len(first.root)) for f in figures):
        raise ValueError("figures of one recording have one rate and length")
    times = START_NS + np.round(np.arange(len(first.root)) * 1e9 / first.rate).astype(np.int64)
    with atomic(path) as temporary, temporary.open("wb") as stream:
        writer = Writer(
            stream, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD, enable_data_crcs=True
        )
        writer.start(profile="", library="kinemimic")
        writer.add_metadata(METADATA_NAME, {key: json.dumps(value) for key, value in metadata.items()})
        clouds = register_schema(writer, PointCloud)
        joints = writer.register_schema("sensor_msgs/msg/JointState", "ros2msg", JOINT_STATE.encode())
        frames = writer.register_channel("/tf", "protobuf", register_schema(writer, FrameTransforms))
        scene = writer.register_channel("/scene", "protobuf", register_schema(writer, SceneUpdate))
        streams = []
        for figure in figures:
            cloud = writer.register_channel(f"/{figure.name}/skeleton", "protobuf", clouds)
            state = writer.register_channel(f"/{figure.name}/joint_states", "cdr", joints)
            streams.append((cloud, skeleton_messages(figure.motion, times)))
            streams.append((state, joint_state_messages(figure.motion, times)))
        writer.add_message(scene, START_NS, _scene(figures), START_NS)
        for frame, time in enumerate(times.tolist()):
            writer.add_message(frames, time, _transforms(figures, frame, time), time, frame)
            for channel, messages in streams:
                writer.add_message(channel, time, next(messages), time, frame)
        writer.finish()  # type: ignore[no-untyped-call]


def _transforms(figures: Sequence[Figure], frame: int, time: int) -> bytes:
    message, now = FrameTransforms(), stamp(time)
    for figure in figures:
        motion = figure.motion
        for node, name in NODE_FRAMES.items():
            index = NODE_INDEX[node]
            parent = NODE_PARENTS[index]
            above = f"{figure.name}/{NODE_FRAMES[NODES[parent]]}" if parent >= 0 else WORLD_FRAME
            offset = motion.offsets[index] if parent >= 0 else motion.root[frame]
            rotation = motion.rotations[frame, index]
            message.transforms.append(transform(now, above, f"{figure.name}/{name}", offset, rotation))
    return bytes(message.SerializeToString(deterministic=True))


def _scene(figures: Sequence[Figure]) -> bytes:
    update = SceneUpdate()
    for figure in figures:
        for body in BODIES:
            frame = f"{figure.name}/{NODE_FRAMES[body.node]}"
            entity = SceneEntity(timestamp=stamp(START_NS), frame_id=frame, id=frame, frame_locked=True)
            _add_shape(entity, body, figure.color)
            update.entities.append(entity)
    return bytes(update.SerializeToString(deterministic=True))


def _add_shape(entity: SceneEntity, body: Body, color: tuple[float, float, float, float]) -> None:
    """The shape that is simulated; Foxglove has no capsule: a cylinder and two spheres."""
    red, green, blue, alpha = color
    paint = Color(r=red, g=green, b=blue, a=alpha)
    size, center = np.array(body.size), np.array(body.center)
    if body.shape == "box":
        cube = CubePrimitive(color=paint)
        _place(cube, center, size)
        entity.cubes.append(cube)
        return
    half = np.array([0.0, 0.0, 0.5 * (size[2] - size[0])])
    for end in (half, -half) if half.any() else (half,):
        ball = SpherePrimitive(color=paint)
        _place(ball, center + end, np.full(3, size[0]))
        entity.spheres.append(ball)
    if half.any():
        rod = CylinderPrimitive(color=paint, bottom_scale=1.0, top_scale=1.0)
        _place(rod, center, np.array([size[0], size[0], 2 * half[2]]))
        entity.cylinders.append(rod)


def _place(shape: Any, center: Array, size: Array) -> None:
    """Set a primitive's pose and outer dimensions."""
    position, turn = shape.pose.position, shape.pose.orientation
    position.x, position.y, position.z = center.tolist()
    turn.x, turn.y, turn.z, turn.w = IDENTITY.tolist()
    shape.size.x, shape.size.y, shape.size.z = size.tolist()
