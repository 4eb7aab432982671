"""Animated figures as binary glTF 2.0 (.glb), which browsers, game engines and modelling programs open."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.files.store import atomic
from kinemimic.pipeline.kinematics.rotations import continuous
from kinemimic.pipeline.kinematics.skeleton import NODE_PARENTS, NODES
from kinemimic.retarget.formats.body_meshes import body_mesh
from kinemimic.retarget.humanoid.body import BODIES
from kinemimic.retarget.humanoid.motion import Motion

_FLOAT, _SHORT = 5126, 5123  # glTF's component types
_VERTICES, _INDICES = 34962, 34963  # its targets of buffer views
_LENGTHS = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}


@dataclass(frozen=True)
class Figure:
    """A moving figure: its name, motion, and colour (red, green, blue, opacity), 0 to 1, linear."""

    name: str
    motion: Motion
    color: tuple[float, float, float, float]


def write_glb(path: Path, figures: Sequence[Figure], provenance: Mapping[str, Any]) -> None:
    """Write figures of one frame rate as a scene with one animation, deterministically and atomically.

    glTF's axes: X left, Y up, Z forward, metres. Each figure is a tree of 20 nodes FIGURE/NODE below a node
    of its name; the 15 bodies are meshes of their nodes. The animation moves the hip centre and rotates the
    nodes that carry a body, linearly between frames; frame 0 is at 0 s. A cycle is written once. provenance:
    JSON values, in the `extras` of the file.
    """
    scene = _Scene()
    roots = [scene.add(figure, material) for material, figure in enumerate(figures)]
    animation = {
        "name": " and ".join(figure.name for figure in figures),
        "channels": scene.channels,
        "samplers": scene.samplers,
    }
    document = {
        "asset": {"version": "2.0", "generator": "kinemimic", "extras": {"provenance": dict(provenance)}},
        "scene": 0,
        "scenes": [{"name": "kinemimic", "nodes": roots}],
        "nodes": scene.nodes,
        "meshes": scene.meshes,
        "materials": [_material(figure) for figure in figures],
        "animations": [animation],
        "accessors": scene.buffer.accessors,
        "bufferViews": scene.buffer.views,
        "buffers": [{"byteLength": len(scene.buffer.data)}],
    }
    text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
    parts = ((_padded(text, b" "), b"JSON"), (_padded(bytes(scene.buffer.data), b"\0"), b"BIN\0"))
    chunks = b"".join(struct.pack("<I4s", len(part), kind) + part for part, kind in parts)
    with atomic(path) as temporary:
        temporary.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


class _Scene:
    """Nodes and meshes of all figures, the samplers and channels that move them, and the numbers behind."""

    def __init__(self) -> None:
        self.buffer = _Buffer()
        self.nodes: list[dict[str, Any]] = []
        self.meshes: list[dict[str, Any]] = []
        self.channels: list[dict[str, Any]] = []
        self.samplers: list[dict[str, Any]] = []
        # The figures share the shapes of their bodies.
        self._shapes = {body.node: (body.name, _shape(self.buffer, k)) for k, body in enumerate(BODIES)}

    def add(self, figure: Figure, material: int) -> int:
        """Add a figure; returns the index of its root, which the 20 nodes follow."""
        motion, root = figure.motion, len(self.nodes)
        rotations = continuous(motion.rotations)
        times = self.buffer.add(np.arange(len(motion.root)) / motion.rate, limits=True)
        self.nodes.append({"name": figure.name, "children": [root + 1]})
        for index, (name, parent) in enumerate(zip(NODES, NODE_PARENTS, strict=True)):
            node: dict[str, Any] = {
                "name": f"{figure.name}/{name}",
                "translation": _y_up(motion.offsets[index] if parent >= 0 else motion.root[0]).tolist(),
                "rotation": _turned(rotations[0, index]).tolist(),
            }
            if children := [root + 1 + k for k, above in enumerate(NODE_PARENTS) if above == index]:
                node["children"] = children
            if name in self._shapes:
                node["mesh"] = self._mesh(figure, name, material)
                self._animate(root + 1 + index, "rotation", times, _turned(rotations[:, index]))
            if parent < 0:
                self._animate(root + 1 + index, "translation", times, _y_up(motion.root))
            self.nodes.append(node)
        return root

    def _mesh(self, figure: Figure, node: str, material: int) -> int:
        """Add the mesh of the body that a node carries; returns its index."""
        body, shape = self._shapes[node]
        self.meshes.append({"name": f"{figure.name}/{body}", "primitives": [{**shape, "material": material}]})
        return len(self.meshes) - 1

    def _animate(self, node: int, path: str, times: int, values: Array) -> None:
        """Move a node's rotation or translation; times: the accessor of the frames' times."""
        self.channels.append({"sampler": len(self.samplers), "target": {"node": node, "path": path}})
        self.samplers.append({"input": times, "output": self.buffer.add(values)})


class _Buffer:
    """The binary part of the file, with the descriptions of the arrays in it."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, values: NDArray[Any], target: int | None = None, *, limits: bool = False) -> int:
        """Append (N,) or (N, 3 or 4) numbers, whole ones as 16 bits; returns the accessor's index.

        target: of the buffer view; limits: state the smallest and largest values, where glTF requires it.
        """
        whole = np.issubdtype(values.dtype, np.integer)
        stored = np.ascontiguousarray(values, "<u2" if whole else "<f4")
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": stored.nbytes}
        self.views.append(view if target is None else {**view, "target": target})
        self.data += _padded(stored.tobytes(), b"\0")
        columns = stored.reshape(len(stored), -1)
        accessor = {
            "bufferView": len(self.views) - 1,
            "componentType": _SHORT if whole else _FLOAT,
            "count": len(stored),
            "type": _LENGTHS[columns.shape[1]],
        }
        if limits:
            accessor |= {"min": columns.min(axis=0).tolist(), "max": columns.max(axis=0).tolist()}
        self.accessors.append(accessor)
        return len(self.accessors) - 1


def _shape(buffer: _Buffer, index: int) -> dict[str, Any]:
    """The mesh of a body as a glTF primitive without its material."""
    mesh = body_mesh(BODIES[index])
    return {
        "attributes": {
            "POSITION": buffer.add(_y_up(mesh.vertices), _VERTICES, limits=True),
            "NORMAL": buffer.add(_y_up(mesh.normals), _VERTICES),
        },
        "indices": buffer.add(mesh.triangles.ravel(), _INDICES),
    }


def _material(figure: Figure) -> dict[str, Any]:
    material: dict[str, Any] = {
        "name": figure.name,
        "pbrMetallicRoughness": {
            "baseColorFactor": list(figure.color), "metallicFactor": 0.0, "roughnessFactor": 0.6,
        },
    }  # fmt: skip
    return material | ({"alphaMode": "BLEND"} if figure.color[3] < 1 else {})


def _y_up(vectors: Array) -> Array:
    """Vectors (..., 3) in glTF's axes: left, up, forward."""
    return vectors[..., [1, 2, 0]]


def _turned(rotations: Array) -> Array:
    """Rotations (..., 4) in glTF's axes, of unit length in 32 bits."""
    return rotations[..., [1, 2, 0, 3]]


def _padded(data: bytes, fill: bytes) -> bytes:
    return data + fill * (-len(data) % 4)
