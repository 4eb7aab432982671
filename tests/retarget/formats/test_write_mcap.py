"""Motions as MCAP: the transforms are the motion's kinematics, and rerun draws them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory as ProtobufDecoder
from mcap_ros2.decoder import DecoderFactory as Ros2Decoder
from rerun.chunk import RrdReader

from kinemimic.pipeline.kinematics.rotations import angle_between, multiply, normalize, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES
from kinemimic.retarget.formats.urdf import humanoid_urdf
from kinemimic.retarget.formats.write_mcap import CYCLIC_SECONDS, NODE_FRAMES, START_NS, write_mcap
from kinemimic.retarget.humanoid.motion import Motion, joint_angles

CYCLE = 33  # frames


def motion(*, cyclic: bool = True) -> Motion:
    """Every node rotates in every frame; a cycle advances by 1.3 m."""
    random = np.random.default_rng(5)
    rotations = normalize(np.array([0.0, 0.0, 0.0, 1.0]) + 0.3 * random.normal(size=(CYCLE, len(NODES), 4)))
    return Motion(
        rate=29.5,
        root=random.normal(size=(CYCLE, 3)),
        rotations=rotations,
        contacts=np.ones((CYCLE, 2), dtype=bool),
        cyclic=cyclic,
        cycle_offset=np.array([1.3, 0.0, 0.0]),
        provenance={"source": "a.skl", "simulated": True},
    )


def messages(path: Path, topic: str) -> list[tuple[int, Any]]:
    """Log times and decoded messages of a topic."""
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[ProtobufDecoder(), Ros2Decoder()])
        return [
            (raw.log_time, decoded) for _, _, raw, decoded in reader.iter_decoded_messages(topics=[topic])
        ]


@pytest.fixture(scope="module")
def cyclic(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("mcap") / "motion.mcap"
    write_mcap(path, motion())
    return path


def test_transforms_are_the_forward_kinematics(cyclic: Path) -> None:
    positions, rotations = motion().kinematics()
    for frame, (_, message) in enumerate(messages(cyclic, "/tf")):
        world = {"world": (np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))}
        for link in message.transforms:
            place, turn = world[link.parent_frame_id]
            t, q = link.translation, link.rotation
            world[link.child_frame_id] = (
                place + rotate(turn, np.array([t.x, t.y, t.z])),
                multiply(turn, np.array([q.x, q.y, q.z, q.w])),
            )
        cycle, step = divmod(frame, CYCLE)
        for node, name in NODE_FRAMES.items():
            place, turn = world[name]
            expected = positions[step, NODE_INDEX[node]] + [1.3 * cycle, 0.0, 0.0]
            np.testing.assert_allclose(place, expected, atol=1e-12)
            assert angle_between(turn, rotations[step, NODE_INDEX[node]]) < 1e-7


def test_only_a_cycle_is_repeated(cyclic: Path, tmp_path: Path) -> None:
    times = [time for time, _ in messages(cyclic, "/tf")]
    assert len(times) == 295  # ten seconds at 29.5 frames a second
    assert (times[0], times[1] - times[0]) == (START_NS, round(1e9 / 29.5))
    assert times[-1] == START_NS + round(294e9 / 29.5) < START_NS + CYCLIC_SECONDS * 1e9
    write_mcap(tmp_path / "once.mcap", motion(cyclic=False))
    assert len(messages(tmp_path / "once.mcap", "/tf")) == CYCLE


def test_points_angles_description_and_provenance(cyclic: Path) -> None:
    positions, _ = motion().kinematics()
    cloud = messages(cyclic, "/skeleton")[CYCLE + 4][1]
    xyz = (
        np.frombuffer(cloud.data, np.uint8).reshape(len(NODES), cloud.point_stride)[:, :12].copy().view("<f4")
    )
    np.testing.assert_allclose(xyz, positions[4] + [1.3, 0.0, 0.0], atol=1e-6)

    curves = joint_angles(motion().rotations)
    _, state = messages(cyclic, "/joint_states")[4]
    assert state.name == list(curves)
    np.testing.assert_allclose(state.position, [curve[4] for curve in curves.values()], rtol=1e-12)
    rise = [(curve[5] - curve[3]) * 29.5 / 2 for curve in curves.values()]
    np.testing.assert_allclose(state.velocity, rise, rtol=1e-9)

    assert messages(cyclic, "/robot_description")[0][1].data == humanoid_urdf("floating")
    with cyclic.open("rb") as stream:
        (record,) = make_reader(stream).iter_metadata()
    assert json.loads(record.metadata["provenance"]) == motion().provenance
    assert record.metadata["simulated_capture"] == "true"


def test_same_motion_same_bytes(cyclic: Path, tmp_path: Path) -> None:
    write_mcap(tmp_path / "again.mcap", motion())
    assert (tmp_path / "again.mcap").read_bytes() == cyclic.read_bytes()


def test_rerun_draws_the_humanoid(cyclic: Path, tmp_path: Path) -> None:
    recording = tmp_path / "motion.rrd"
    for arguments in (
        ["mcap", "check", str(cyclic)],
        ["mcap", "convert", str(cyclic), "-o", str(recording)],
        ["rrd", "verify", str(recording)],
    ):
        command = [sys.executable, "-m", "rerun_cli", *arguments]
        # With CI set, the program collects no usage data.
        subprocess.run(command, check=True, capture_output=True, env={**os.environ, "CI": "true"})
    columns: dict[str, set[str]] = {}
    drawn: list[Any] = []
    for chunk in RrdReader(recording).store().stream():
        batch = chunk.to_record_batch()
        columns.setdefault(str(chunk.entity_path), set()).update(batch.schema.names)
        if str(chunk.entity_path) == "/skeleton" and "Points3D:positions" in batch.schema.names:
            times, points = (batch[name].to_pylist() for name in ("message_log_time", "Points3D:positions"))
            drawn += zip(times, points, strict=True)
    places = np.array([points for _, points in sorted(drawn, key=lambda row: row[0])])
    assert places.shape == (295, len(NODES), 3)
    np.testing.assert_allclose(places[:CYCLE], motion().kinematics()[0], atol=1e-6)
    assert {"Transform3D:translation", "Transform3D:quaternion"} <= columns["/tf"]
    assert "Points3D:positions" in columns["/skeleton"]
    shapes = {
        path.split("/")[3] for path in columns if path.startswith("/kinemimic_humanoid/visual_geometries/")
    }
    assert len(shapes) == 15
