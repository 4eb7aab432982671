"""The glTF scene has our figures at our positions, in glTF's axes, and closed meshes that face outwards."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples.motion import rigid_walk
from scipy.spatial.transform import Rotation

from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.retarget.formats.body_meshes import body_mesh
from kinemimic.retarget.formats.gltf import Figure, write_glb
from kinemimic.retarget.humanoid.body import BODIES, Body
from kinemimic.retarget.humanoid.motion import Motion

FRAMES = 40
WIDTH = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}


class Glb:
    """A .glb as the specification of glTF 2.0 lays it out."""

    def __init__(self, path: Path) -> None:
        data = path.read_bytes()
        magic, version, length, size, kind = struct.unpack("<4sII I4s", data[:20])
        assert (magic, version, length, kind) == (b"glTF", 2, len(data), b"JSON") and size % 4 == 0
        self.json: dict[str, Any] = json.loads(data[20 : 20 + size])
        binary, kind = struct.unpack("<I4s", data[20 + size : 28 + size])
        assert kind == b"BIN\0" and 28 + size + binary == len(data)
        self.data = data[28 + size :]
        assert self.json["buffers"] == [{"byteLength": binary}]

    def array(self, accessor: int) -> np.ndarray:
        one = self.json["accessors"][accessor]
        view = self.json["bufferViews"][one["bufferView"]]
        kind = {5126: "<f4", 5123: "<u2"}[one["componentType"]]
        raw = self.data[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
        found = np.frombuffer(raw, kind).reshape(one["count"], WIDTH[one["type"]])
        for bound, reduce in (("min", np.min), ("max", np.max)):
            if bound in one:
                np.testing.assert_allclose(one[bound], reduce(found, axis=0), atol=1e-6)
        return found

    def positions(self, frame: int) -> dict[str, np.ndarray]:
        """World positions of all nodes in a frame of the animation."""
        nodes = self.json["nodes"]
        local = {
            k: [np.array(n.get("translation", [0, 0, 0])), np.array(n.get("rotation", [0, 0, 0, 1]))]
            for k, n in enumerate(nodes)
        }
        animation = self.json["animations"][0]
        for channel in animation["channels"]:
            sampler = animation["samplers"][channel["sampler"]]
            value = self.array(sampler["output"])[frame]
            local[channel["target"]["node"]][("translation", "rotation").index(channel["target"]["path"])] = (
                value
            )
        found = {}

        def descend(node: int, place: np.ndarray, turn: Rotation) -> None:
            place = place + turn.apply(local[node][0])
            turn = turn * Rotation.from_quat(local[node][1])
            found[nodes[node]["name"]] = place
            for child in nodes[node].get("children", []):
                descend(child, place, turn)

        for root in self.json["scenes"][0]["nodes"]:
            descend(root, np.zeros(3), Rotation.identity())
        return found


@pytest.fixture(scope="module")
def motions() -> dict[str, Motion]:
    shown = rigid_walk(FRAMES, 30.0)
    walk = Motion(30.0, shown.root, shown.rotations, np.zeros((FRAMES, 2), dtype=bool), cyclic=False)
    aside = Motion(30.0, shown.root + np.array([0.0, 0.7, 0.0]), shown.rotations, walk.contacts, cyclic=False)
    return {"simulated": walk, "reference": aside}


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory, motions: dict[str, Motion]) -> Path:
    path = tmp_path_factory.mktemp("gltf") / "walk.glb"
    colors = {"simulated": (1.0, 0.3, 0.0, 1.0), "reference": (0.2, 0.5, 1.0, 0.4)}
    write_glb(path, [Figure(k, v, colors[k]) for k, v in motions.items()], {"simulated": True})
    return path


@pytest.mark.parametrize("frame", [0, 17, FRAMES - 1])
def test_nodes_are_where_the_motions_have_them(path: Path, motions: dict[str, Motion], frame: int) -> None:
    found = Glb(path).positions(frame)
    for name, motion in motions.items():
        positions, _ = motion.kinematics()
        for k, node in enumerate(NODES):
            x, y, z = positions[frame, k]
            np.testing.assert_allclose(found[f"{name}/{node}"], [y, z, x], atol=2e-6)


def test_the_animation_is_in_real_time(path: Path) -> None:
    glb = Glb(path)
    (animation,) = glb.json["animations"]
    assert len(animation["channels"]) == 2 * (len(BODIES) + 1)
    for sampler in animation["samplers"]:
        np.testing.assert_allclose(glb.array(sampler["input"])[:, 0], np.arange(FRAMES) / 30, atol=1e-6)
        values = glb.array(sampler["output"])
        if values.shape[1] == 4:
            np.testing.assert_allclose(np.linalg.norm(values, axis=1), 1, atol=1e-6)
            assert ((values[1:] * values[:-1]).sum(axis=1) > 0).all()


def test_bodies_are_meshes_of_their_nodes_and_the_reference_is_translucent(path: Path) -> None:
    glb = Glb(path).json
    for name in ("simulated", "reference"):
        for body in BODIES:
            (node,) = [n for n in glb["nodes"] if n["name"] == f"{name}/{body.node}"]
            mesh = glb["meshes"][node["mesh"]]
            assert mesh["name"] == f"{name}/{body.name}"
            assert glb["materials"][mesh["primitives"][0]["material"]]["name"] == name
    assert [one.get("alphaMode") for one in glb["materials"]] == [None, "BLEND"]
    assert glb["asset"]["extras"] == {"provenance": {"simulated": True}}


@pytest.mark.parametrize("body", BODIES, ids=lambda body: body.name)
def test_meshes_are_closed_face_outwards_and_have_the_volume_of_the_shape(body: Body) -> None:
    mesh = body_mesh(body)
    center = np.array(body.center)
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), body.size, rtol=1e-9)
    np.testing.assert_allclose((mesh.vertices.min(0) + mesh.vertices.max(0)) / 2, center, atol=1e-9)
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] - center for k in range(3))
    volume = (np.cross(a, b) * c).sum() / 6
    x, _, z = body.size
    exact = np.prod(body.size) if body.shape == "box" else np.pi * (x**3 / 6 + x * x / 4 * (z - x))
    assert volume == pytest.approx(exact, rel=0.05)
    faces = np.cross(b - a, c - a)
    outward = mesh.normals[mesh.triangles].mean(axis=1)
    assert ((faces * outward).sum(axis=1) > 0).all()
    # Closed: every edge, by the places of its ends, is used once in each direction.
    places = {tuple(np.round(v, 9) + 0.0): k for k, v in enumerate(mesh.vertices)}
    ids = [[places[tuple(np.round(mesh.vertices[k], 9) + 0.0)] for k in row] for row in mesh.triangles]
    edges = [(row[k], row[(k + 1) % 3]) for row in ids for k in range(3)]
    assert len(set(edges)) == len(edges)
    assert {(b, a) for a, b in edges} == set(edges)
