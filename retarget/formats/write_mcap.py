"""Writing motions as MCAP, which rerun and Foxglove show as a moving humanoid.

Both draw the URDF of `/robot_description` and move it by the transforms of `/tf`. rerun supports neither
Foxglove messages in JSON nor Foxglove joint states: hence protobuf for the former and ROS 2 for the latter.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from google.protobuf.timestamp_pb2 import Timestamp
from mcap.writer import CompressionType, Writer
from mcap_protobuf.schema import register_schema
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.files.store import atomic
from kinemimic.pipeline.kinematics.rotations import IDENTITY, continuous
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODE_PARENTS, NODES, SIDES
from kinemimic.retarget.formats.urdf import humanoid_urdf
from kinemimic.retarget.humanoid.body import BODIES
from kinemimic.retarget.humanoid.motion import Motion, joint_angles

WORLD_FRAME = "world"
BASE_FRAME = "base"  # the URDF's massless root link, to which the pelvis is fixed
# The end nodes of limbs carry no body; three of them have the name of the body that they end.
END_FRAMES: dict[str, str] = {
    node: f"{node}_end" for node in NODES if node not in {body.node for body in BODIES}
}
# Node -> frame name; a link's frame is that of its node.
NODE_FRAMES: dict[str, str] = {body.node: body.name for body in BODIES} | END_FRAMES
# Readers of MCAP expect times since 1970; a fixed start keeps the file a function of the motion alone.
START_NS = 946_684_800 * 10**9  # 2000-01-01
CYCLIC_SECONDS = 10.0  # a cycle is repeated for this long; a longer cycle is written once
METADATA_NAME = "kinemimic"  # the metadata record, written before the messages
# A truncated file loses at most one chunk: 85 frames here, 340 with the library's default size, which makes
# files a third smaller.
CHUNK_BYTES = 256 * 1024

_STRING = "string data\n"
JOINT_STATE = f"""std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
{"=" * 80}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{"=" * 80}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
_POINT = np.dtype(
    [(axis, "<f4") for axis in "xyz"] + [(name, "u1") for name in ("red", "green", "blue", "alpha")]
)
_COLORS = {"left": (86, 180, 233, 255), "right": (230, 159, 0, 255), "": (200, 200, 200, 255)}


def write_mcap(path: Path, motion: Motion) -> None:
    """Write a motion as MCAP (zstd), deterministically.

    /tf               foxglove.FrameTransforms: world to base, and every link and end node to its parent
    /robot_description std_msgs/String: the URDF of the Table 1 body
    /skeleton         foxglove.PointCloud: the 20 nodes in the world
    /joint_states     sensor_msgs/JointState: knee and hip flexion, radians and radians a second
    and a metadata record "kinemimic" with the provenance and everything else that `read_mcap` needs. A cycle
    is repeated for CYCLIC_SECONDS, each time displaced by its offset. All parts have checksums.
    """
    played = _repeated(motion)
    times = START_NS + np.round(np.arange(len(played.root)) * 1e9 / played.rate).astype(np.int64)
    with atomic(path) as temporary, temporary.open("wb") as stream:
        writer = Writer(
            stream, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD, enable_data_crcs=True
        )
        writer.start(profile="", library="kinemimic")
        topics = _topics(writer)
        writer.add_metadata(METADATA_NAME, _metadata(motion, len(played.root)))
        urdf = _cdr_string(humanoid_urdf("floating"))
        writer.add_message(topics["/robot_description"], START_NS, urdf, START_NS)
        messages = zip(
            _tf_messages(played, times),
            skeleton_messages(played, times),
            joint_state_messages(played, times),
            strict=True,
        )
        for sequence, (time, row) in enumerate(zip(times.tolist(), messages, strict=True)):
            for topic, data in zip(("/tf", "/skeleton", "/joint_states"), row, strict=True):
                writer.add_message(topics[topic], time, data, time, sequence)
        writer.finish()  # type: ignore[no-untyped-call]


def _repeated(motion: Motion) -> Motion:
    """The frames to write: a cycle is repeated, any other motion is written once."""
    if not motion.cyclic:
        return motion
    frames = max(len(motion.root), int(np.ceil(CYCLIC_SECONDS * motion.rate)))
    cycle, frame = np.divmod(np.arange(frames), len(motion.root))
    return replace(
        motion,
        root=motion.root[frame] + cycle[:, None] * motion.cycle_offset,
        rotations=continuous(motion.rotations[frame]),
        contacts=motion.contacts[frame],
        cyclic=False,
    )


def _metadata(motion: Motion, played: int) -> dict[str, str]:
    """The metadata record, JSON values except `time`; played: frames written, of repeated cycles."""
    return {
        "provenance": json.dumps(motion.provenance, sort_keys=True),
        "simulated_capture": json.dumps(motion.simulated),
        "cyclic": json.dumps(motion.cyclic),
        "fps": json.dumps(float(motion.rate)),
        "frames": json.dumps(len(motion.root)),
        "played": json.dumps(played),
        "cycle_offset": json.dumps(motion.cycle_offset.tolist()),
        "contacts": json.dumps(
            {
                side: planted.astype(int).tolist()
                for side, planted in zip(SIDES, motion.contacts.T, strict=True)
            }
        ),
        "time": "log times begin at 2000-01-01T00:00:00Z, whenever the motion was captured",
    }


def _topics(writer: Writer) -> dict[str, int]:
    """Register schemas and channels; returns topic -> channel."""
    string = writer.register_schema("std_msgs/msg/String", "ros2msg", _STRING.encode())
    joints = writer.register_schema("sensor_msgs/msg/JointState", "ros2msg", JOINT_STATE.encode())
    return {
        "/robot_description": writer.register_channel("/robot_description", "cdr", string),
        "/tf": writer.register_channel("/tf", "protobuf", register_schema(writer, FrameTransforms)),
        "/skeleton": writer.register_channel("/skeleton", "protobuf", register_schema(writer, PointCloud)),
        "/joint_states": writer.register_channel("/joint_states", "cdr", joints),
    }


def stamp(time: int) -> Timestamp:
    seconds, nanoseconds = divmod(time, 10**9)
    return Timestamp(seconds=seconds, nanos=nanoseconds)


def _tf_messages(motion: Motion, times: NDArray[np.int64]) -> Iterator[bytes]:
    """/tf: the root's pose moves the base, to which the pelvis is fixed; all others are local transforms."""
    for frame, time in enumerate(times.tolist()):
        now = stamp(time)
        message = FrameTransforms()
        message.transforms.append(
            transform(now, WORLD_FRAME, BASE_FRAME, motion.root[frame], motion.rotations[frame, 0])
        )
        for node, name in NODE_FRAMES.items():
            index = NODE_INDEX[node]
            parent = NODE_PARENTS[index]
            # The pelvis too, although the URDF fixes it to the base: rerun takes no transforms from the URDF.
            above = NODE_FRAMES[NODES[parent]] if parent >= 0 else BASE_FRAME
            offset, rotation = motion.offsets[index], motion.rotations[frame, index]
            message.transforms.append(
                transform(now, above, name, offset, rotation if parent >= 0 else IDENTITY)
            )
        yield message.SerializeToString(deterministic=True)


def transform(time: Timestamp, parent: str, child: str, offset: Array, rotation: Array) -> FrameTransform:
    message = FrameTransform(timestamp=time, parent_frame_id=parent, child_frame_id=child)
    message.translation.x, message.translation.y, message.translation.z = offset.tolist()
    turn = message.rotation
    turn.x, turn.y, turn.z, turn.w = rotation.tolist()
    return message


def skeleton_messages(motion: Motion, times: NDArray[np.int64]) -> Iterator[bytes]:
    """/skeleton: left blue, right orange, trunk and head grey."""
    positions, _ = motion.kinematics()
    kinds = {"<f4": PackedElementField.FLOAT32, "|u1": PackedElementField.UINT8}
    fields = [
        PackedElementField(name=name, offset=offset, type=kinds[kind.str])
        for name, (kind, offset, *_) in (_POINT.fields or {}).items()
    ]
    points = np.zeros(len(NODES), _POINT)
    for node in NODES:
        side = node.rpartition("_")[2]
        color = _COLORS.get(side, _COLORS[""])
        for name, value in zip(("red", "green", "blue", "alpha"), color, strict=True):
            points[name][NODE_INDEX[node]] = value
    for frame, time in enumerate(times.tolist()):
        for k, axis in enumerate("xyz"):
            points[axis] = positions[frame, :, k]
        message = PointCloud(
            timestamp=stamp(time), frame_id=WORLD_FRAME, point_stride=_POINT.itemsize, fields=fields
        )
        message.pose.orientation.w = 1.0
        # Set although it is zero: without it, rerun writes recordings that it cannot read.
        message.pose.position.SetInParent()
        message.data = points.tobytes()
        yield message.SerializeToString(deterministic=True)


def joint_state_messages(motion: Motion, times: NDArray[np.int64]) -> Iterator[bytes]:
    """/joint_states: knee and hip flexion."""
    curves = joint_angles(motion.rotations)
    names = list(curves)
    angles = np.stack([curves[name] for name in names], axis=-1)
    speeds = np.gradient(angles, 1.0 / motion.rate, axis=0) if len(angles) > 1 else np.zeros_like(angles)
    for time, positions, velocities in zip(times.tolist(), angles.tolist(), speeds.tolist(), strict=True):
        yield _cdr_joint_state(time, names, positions, velocities)


_CDR_HEADER = b"\x00\x01\x00\x00"  # marker: plain CDR, little-endian


def _cdr_text(value: str) -> bytes:
    """A string in CDR: its length including the terminating zero, then its bytes."""
    data = value.encode() + b"\0"
    return struct.pack("<I", len(data)) + data


def _cdr_string(value: str) -> bytes:
    """std_msgs/String in CDR."""
    return _CDR_HEADER + _cdr_text(value)


def _cdr_joint_state(time: int, names: Sequence[str], *values: Sequence[float]) -> bytes:
    """sensor_msgs/JointState in CDR, without efforts; values are aligned to their size after the header."""
    body = struct.pack("<iI", *divmod(time, 10**9))
    for part in (_cdr_text(""), struct.pack("<I", len(names)), *map(_cdr_text, names)):
        body = _aligned(body, 4) + part
    for numbers in values:
        body = _aligned(body, 4) + struct.pack("<I", len(numbers))
        body = _aligned(body, 8) + struct.pack(f"<{len(numbers)}d", *numbers)
    return _CDR_HEADER + body + struct.pack("<I", 0)


def _aligned(data: bytes, size: int) -> bytes:
    return data + b"\0" * (-len(data) % size)
