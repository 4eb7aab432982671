"""One MCAP with two figures: each at its place in every frame, and shapes of its own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from mcap_ros2.decoder import DecoderFactory as Ros2Decoder
from samples.motion import rigid_walk
from scipy.spatial.transform import Rotation

from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.retarget.formats.gltf import Figure
from kinemimic.retarget.formats.write_mcap_figures import write_mcap_figures
from kinemimic.retarget.humanoid.body import BODIES
from kinemimic.retarget.humanoid.motion import Motion, joint_angles

FRAMES = 20


@pytest.fixture(scope="module")
def motions() -> dict[str, Motion]:
    shown = rigid_walk(FRAMES, 30.0)
    contacts = np.zeros((FRAMES, 2), dtype=bool)
    return {
        name: Motion(30.0, shown.root + np.array([0, aside, 0]), shown.rotations, contacts, cyclic=False)
        for name, aside in (("simulated", 0.0), ("reference", 0.7))
    }


def figures(motions: dict[str, Motion]) -> list[Figure]:
    return [Figure(name, motion, (1.0, 0.5, 0.0, 0.4)) for name, motion in motions.items()]


@pytest.fixture(scope="module")
def messages(tmp_path_factory: pytest.TempPathFactory, motions: dict[str, Motion]) -> dict[str, list[Any]]:
    path = tmp_path_factory.mktemp("mcap") / "both.mcap"
    write_mcap_figures(path, figures(motions), {"simulated": True})
    found: dict[str, list[Any]] = {}
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory(), Ros2Decoder()], validate_crcs=True)
        for _, channel, _, decoded in reader.iter_decoded_messages():
            found.setdefault(channel.topic, []).append(decoded)
        assert [record.metadata for record in reader.iter_metadata()] == [{"simulated": "true"}]
    return found


def test_topics_have_a_message_for_each_frame(messages: dict[str, list[Any]]) -> None:
    assert {topic: len(those) for topic, those in messages.items()} == {
        "/tf": FRAMES, "/scene": 1,
        "/simulated/skeleton": FRAMES, "/reference/skeleton": FRAMES,
        "/simulated/joint_states": FRAMES, "/reference/joint_states": FRAMES,
    }  # fmt: skip


def test_frames_chained_to_the_world_are_the_nodes_of_each_figure(
    messages: dict[str, list[Any]], motions: dict[str, Motion]
) -> None:
    for frame in (0, FRAMES - 1):
        poses: dict[str, tuple[np.ndarray, Rotation]] = {"world": (np.zeros(3), Rotation.identity())}
        for one in messages["/tf"][frame].transforms:  # parents come first
            place, turn = poses[one.parent_frame_id]
            t, q = one.translation, one.rotation
            assert one.child_frame_id not in poses
            poses[one.child_frame_id] = (
                place + turn.apply([t.x, t.y, t.z]), turn * Rotation.from_quat([q.x, q.y, q.z, q.w]),
            )  # fmt: skip
        assert len(poses) == 1 + 2 * 20
        for name, motion in motions.items():
            positions, rotations = motion.kinematics()
            for body in BODIES:
                place, turn = poses[f"{name}/{body.name}"]
                np.testing.assert_allclose(place, positions[frame, NODE_INDEX[body.node]], atol=1e-9)
                true = Rotation.from_quat(rotations[frame, NODE_INDEX[body.node]])
                assert (turn * true.inv()).magnitude() < 1e-7


def test_each_body_has_its_shape_in_its_frame(messages: dict[str, list[Any]]) -> None:
    (update,) = messages["/scene"]
    entities = {entity.frame_id: entity for entity in update.entities}
    assert set(entities) == {f"{name}/{b.name}" for name in ("simulated", "reference") for b in BODIES}
    for body in BODIES:
        entity = entities[f"reference/{body.name}"]
        assert entity.frame_locked
        parts = [*entity.cubes, *entity.spheres, *entity.cylinders]
        assert len(parts) == {"box": 1, "sphere": 1, "ellipsoid": 3}[body.shape]
        assert {round(part.color.a, 6) for part in parts} == {0.4}
        low = np.min(
            [[getattr(p.pose.position, k) - getattr(p.size, k) / 2 for k in "xyz"] for p in parts], axis=0
        )
        high = np.max(
            [[getattr(p.pose.position, k) + getattr(p.size, k) / 2 for k in "xyz"] for p in parts], axis=0
        )
        np.testing.assert_allclose(high - low, body.size, atol=1e-9)
        np.testing.assert_allclose((high + low) / 2, body.center, atol=1e-9)


def test_joint_states_are_those_of_each_figure(
    messages: dict[str, list[Any]], motions: dict[str, Motion]
) -> None:
    for name, motion in motions.items():
        curves = joint_angles(motion.rotations)
        state = messages[f"/{name}/joint_states"][7]
        for joint, angle in zip(state.name, state.position, strict=True):
            assert angle == pytest.approx(curves[joint][7])


def test_figures_of_another_length_are_refused(tmp_path: Path, motions: dict[str, Motion]) -> None:
    one = motions["simulated"]
    short = Motion(30.0, one.root[:5], one.rotations[:5], one.contacts[:5], cyclic=False)
    with pytest.raises(ValueError, match="one rate and length"):
        write_mcap_figures(tmp_path / "a.mcap", figures({"a": one, "b": short}), {})
    assert not list(tmp_path.iterdir())
