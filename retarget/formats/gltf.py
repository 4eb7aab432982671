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
    buffer = _Buffer()
    nodes: list[dict[str, Any]] = []
    channels: list[dict[str, Any]] = []
    samplers: list[dict[str, Any]] = []
    shapes = [_shape(buffer, k) for k in range(len(BODIES))]
    meshes: list[dict[str, Any]] = []
    roots = []
    for material, figure in enumerate(figures):
        motion, first = figure.motion, len(nodes)
        roots.append(first)
        nodes.append({"name": figure.name, "children": [first + 1]})
        rotations = continuous(motion.rotations)
        times = buffer.add(np.arange(len(motion.root)) / motion.rate, limits=True)

        def animate(
            node: int, path: str, values: Array, channels: list[dict[str, Any]] = channels, times: int = times
        ) -> None:
            channels.append({"sampler": len(samplers), "target": {"node": node, "path": path}})
            samplers.append({"input": times, "output": buffer.add(values)})

        for index, (name, parent) in enumerate(zip(NODES, NODE_PARENTS, strict=True)):
            node: dict[str, Any] = {
                "name": f"{figure.name}/{name}",
                "translation": _y_up(motion.offsets[index] if parent >= 0 else motion.root[0]).tolist(),
                "rotation": _turned(rotations[0, index]).tolist(),
            }
            if children := [first + 1 + k for k, above in enumerate(NODE_PARENTS) if above == index]:
                node["children"] = children
            for shape, body in zip(shapes, BODIES, strict=True):
                if body.node == name:
                    node["mesh"] = len(meshes)
                    meshes.append(
                        {
                            "name": f"{figure.name}/{body.name}",
                            "primitives": [{**shape, "material": material}],
                        }
                    )
                    animate(first + 1 + index, "rotation", _turned(rotations[:, index]))
            if parent < 0:
                animate(first + 1 + index, "translation", _y_up(motion.root))
            nodes.append(node)
    document = {
        "asset": {"version": "2.0", "generator": "kinemimic", "extras": {"provenance": dict(provenance)}},
        "scene": 0,
        "scenes": [{"name": "kinemimic", "nodes": roots}],
        "nodes": nodes,
        "meshes": meshes,
        "materials": [_material(figure) for figure in figures],
        "animations": [
            {"name": " and ".join(f.name for f in figures), "channels": channels, "samplers": samplers}
        ],
        "accessors": buffer.accessors,
        "bufferViews": buffer.views,
        "buffers": [{"byteLength": len(buffer.data)}],
    }
    text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
    chunks = b"".join(
        struct.pack("<I4s", len(part), kind) + part
        for part, kind in ((_padded(text, b" "), b"JSON"), (_padded(bytes(buffer.data), b"\0"), b"BIN\0"))
    )
    with atomic(path) as temporary:
        temporary.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


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
