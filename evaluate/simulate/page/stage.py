"""The scene of the page: humanoid, reference, ground, obstacles and forces, as nodes of viser.

All nodes are below a frame that moves with the humanoid, so that every viewer's camera follows without being
touched. viser's quaternions begin with w; ours end with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import trimesh
import viser

from kinemimic.evaluate.film import arrow_scales
from kinemimic.evaluate.film.figures import COLORS, REFERENCE, SIMULATED
from kinemimic.evaluate.film.solids import shaded_side
from kinemimic.evaluate.simulate.session.frame import Frame
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.gravity import GRAVITY
from kinemimic.pipeline.kinematics.orientation.trunk import swing
from kinemimic.pipeline.kinematics.rotations import conjugate, rotate
from kinemimic.pipeline.kinematics.skeleton import BONES
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.spans import all_finite
from kinemimic.retarget.humanoid.body import BODIES, FEET, Body
from kinemimic.train.sim.world import BodyStates, Obstacle

FOLLOWED = "/followed"
MIN_FORCE, MIN_TORQUE = 5.0, 1.0  # N and N·m, below which no arrow is drawn
_RED, _GREEN, _BROWN, _PURPLE = (255, 60, 60), (60, 170, 90), (150, 110, 80), (150, 60, 220)
_FELL = (110, 110, 110)
_GREY, _BLUE = (150, 150, 150), (40, 110, 220)
BESIDE = 1.2  # m
_BONES = [(N[a], N[b]) for a, b in BONES]
_HIDDEN = np.array([[[0.0, 0.0, -50.0], [0.0, 0.0, -50.001]]])  # an arrow that nobody sees
_HALF = 0.5 * np.array([body.size for body in BODIES])
_Look = tuple[int, str, tuple[float, float, float]]  # number, shape and size of an obstacle


class Stage:
    """Draws frames of a session. bodies: the nodes of the humanoid's bodies, which people drag."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server, scene = server, server.scene
        self.follow = True
        self._origin: Array = np.zeros(3)  # of the scene in the session's world
        self._upright: Array = np.array([0.0, 0.0, 0.0, 1.0])  # rotation (4,) from the session's world
        scene.set_up_direction("+z")
        self._frame = scene.add_frame(FOLLOWED, show_axes=False)
        scene.add_grid(
            f"{FOLLOWED}/ground", width=400.0, height=400.0, plane="xy", cell_size=0.5, section_size=5.0,
            infinite_grid=True, fade_distance=25.0,
        )  # fmt: skip
        self.bodies = self._humanoid("humanoid", SIMULATED, opacity=None)
        self._ghost = self._humanoid("reference", REFERENCE, opacity=0.35)
        self._contacts = self._arrows("contacts", _GREEN)
        self._loads = self._arrows("loads", _RED)
        self._torques = self._arrows("torques", _PURPLE)
        self._drag = self._arrows("drag", _RED)
        self._newtons = scene.add_label(f"{FOLLOWED}/newtons", "", visible=False)
        self._raw = self._skeleton("raw", _GREY)
        self._clean = self._skeleton("clean", _BLUE)
        self._latency = scene.add_label(f"{FOLLOWED}/latency", "", visible=False)
        self._obstacles: dict[_Look, Any] = {}  # nodes
        self._companions: list[Any] = []  # nodes of the bodies, each of all companions
        self._fallen = False

    def _humanoid(self, name: str, kind: int, opacity: float | None) -> list[Any]:
        nodes = []
        for body in BODIES:
            color = _color(kind, body.name)
            mesh = _mesh(body.shape, body.size)
            node = self._server.scene.add_mesh_simple(
                f"{FOLLOWED}/{name}/{body.name}", mesh.vertices, mesh.faces, color=color, opacity=opacity,
                cast_shadow=opacity is None, receive_shadow=False,
            )  # fmt: skip
            nodes.append(node)
        return nodes

    def _arrows(self, name: str, color: tuple[int, int, int]) -> Any:
        return self._server.scene.add_arrows(
            f"{FOLLOWED}/{name}", _HIDDEN, color, shaft_radius=0.012, head_radius=0.03, head_length=0.07
        )

    def _skeleton(self, name: str, color: tuple[int, int, int]) -> Any:
        return self._server.scene.add_line_segments(
            f"{FOLLOWED}/capture/{name}",
            _HIDDEN,
            color,
            thickness=4.0,
            thickness_units="screen",
            visible=False,
        )

    @property
    def ghost_visible(self) -> bool:
        """Whether the reference is drawn."""
        return bool(self._ghost[0].visible)

    @ghost_visible.setter
    def ghost_visible(self, visible: bool) -> None:
        for node in self._ghost:
            node.visible = visible

    def in_session(self, point: Array) -> Array:
        """A point of the scene (3,) in the session's world."""
        found: Array = rotate(conjugate(self._upright), point) + self._origin
        return found

    def draw(self, frame: Frame) -> None:
        """Show a frame to all viewers; never waits for one."""
        with self._server.atomic():
            if self.follow:
                self._origin = frame.bodies.positions[0] * [1.0, 1.0, 0.0]
            # A session tilts gravity; to people, the ground is what tilts.
            self._upright = upright(frame.tilt)
            self._frame.position = tuple(-rotate(self._upright, self._origin))
            self._frame.wxyz = tuple(self._upright[[3, 0, 1, 2]])
            _place(self.bodies, frame.bodies)
            if self.ghost_visible:
                _place(self._ghost, frame.target)
            root, feet = frame.bodies.positions[0], frame.bodies.positions[FEET]
            forces, torques = _without_drag(frame)
            _point(self._contacts, root, feet * [1.0, 1.0, 0.0], frame.contacts[FEET] / arrow_scales.CONTACT)
            _point(self._loads, root, _outside(frame.bodies, forces), forces / arrow_scales.FORCE)
            _point(self._torques, root, _outside(frame.bodies, torques), torques / arrow_scales.TORQUE)
            self._newtons.visible = frame.drag is not None
            if frame.drag is None:
                self._drag.points = _HIDDEN
            else:
                grab, pointer, force = frame.drag
                _point(self._drag, root, grab[None], force[None] / arrow_scales.FORCE)
                self._newtons.position = tuple(pointer)
                self._newtons.text = f"{np.linalg.norm(force):.0f} N"
            if frame.fallen != self._fallen:
                self._fallen = frame.fallen
                for body, node in zip(BODIES, self.bodies, strict=True):
                    node.color = _FELL if frame.fallen else _color(SIMULATED, body.name)
            self._draw_obstacles(frame)
            self._draw_companions(frame)
            self._draw_capture(frame)

    def _draw_capture(self, frame: Frame) -> None:
        """The skeletons of a live capture, to the left of the humanoid's reference."""
        shown, place = frame.shown, frame.target.positions[0] * [1.0, 1.0, 0.0]
        for node, points in ((self._raw, shown.raw), (self._clean, shown.clean)) if shown else ():
            segments = skeleton_segments(points)
            node.visible = len(segments) > 0
            if node.visible:
                # As in `_point`.
                node.position, node.points = tuple(place), segments
        if shown is None:
            self._raw.visible = self._clean.visible = self._latency.visible = False
            return
        self._latency.visible = not shown.starved
        self._latency.text = f"{1000.0 * shown.latency:.0f} ms"
        self._latency.position = (place[0], place[1] + BESIDE, 2.0)

    def _draw_companions(self, frame: Frame) -> None:
        shown = frame.companions
        for node in self._companions:
            if node.visible != (shown is not None):
                node.visible = shown is not None
        if shown is None:
            return
        if not self._companions:
            self._companions = [self._instances(body, len(shown.fallen)) for body in BODIES]
        root = frame.bodies.positions[0]
        for index, (body, node) in enumerate(zip(BODIES, self._companions, strict=True)):
            # As in `_point`.
            node.position = tuple(root)
            node.batched_positions = (shown.positions[:, index] - root).astype(np.float32)
            node.batched_wxyzs = shown.rotations[:, index][:, [3, 0, 1, 2]].astype(np.float32)
            colors = np.where(shown.fallen[:, None], _FELL, _color(SIMULATED, body.name)).astype(np.uint8)
            if (node.batched_colors != colors).any():
                node.batched_colors = colors

    def _instances(self, body: Body, count: int) -> Any:
        # Coarse and without shadows: a browser without a graphics card draws all of them.
        mesh = _mesh(body.shape, body.size, count=(6, 6))
        return self._server.scene.add_batched_meshes_simple(
            f"{FOLLOWED}/companions/{body.name}", mesh.vertices, mesh.faces,
            batched_wxyzs=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)), batched_positions=np.zeros((count, 3)),
            batched_colors=np.zeros((count, 3), dtype=np.uint8), lod="off",
            cast_shadow=False, receive_shadow=False,
        )  # fmt: skip

    def _draw_obstacles(self, frame: Frame) -> None:
        # With their looks, because another session counts from 0 again.
        present = [(n, one.shape, one.size) for n, one in zip(frame.numbers, frame.obstacles, strict=True)]
        for gone in self._obstacles.keys() - present:
            self._obstacles.pop(gone).remove()
        for key, obstacle, state in zip(present, frame.obstacles, frame.states, strict=True):
            if key not in self._obstacles:
                mesh = _obstacle_mesh(obstacle)
                self._obstacles[key] = self._server.scene.add_mesh_simple(
                    f"{FOLLOWED}/obstacles/{key[0]}", mesh.vertices, mesh.faces, color=_BROWN
                )
            node = self._obstacles[key]
            node.position, node.wxyz = tuple(state[:3]), tuple(state[[6, 3, 4, 5]])


def upright(tilt: Array) -> Array:
    """The smallest rotation (4,) after which gravity and what a slope adds to it, (3,) m/s², point down."""
    down = np.array([0.0, 0.0, -GRAVITY]) + tilt
    (found,) = swing(down[None] / np.linalg.norm(down), np.array([[0.0, 0.0, -1.0]]), np.pi)
    return np.asarray(found)


def skeleton_segments(points: Array) -> Array:
    """Bones (K, 2, 3) that are seen of a capture's nodes (20, 3), beside the origin on the ground."""
    hips = 0.5 * (points[N["hip_left"]] + points[N["hip_right"]])
    seen = all_finite(points)
    if not np.isfinite(hips).all():
        return np.zeros((0, 2, 3))
    lowest = float(np.min(points[seen, 2]))
    moved = points - [hips[0], hips[1], lowest] + [0.0, BESIDE, 0.0]
    return np.array([(moved[a], moved[b]) for a, b in _BONES if seen[a] and seen[b]]).reshape(-1, 2, 3)


def _color(kind: int, body: str) -> tuple[int, int, int]:
    red, green, blue = map(float, COLORS[kind])
    red, green, blue = shaded_side((red, green, blue), body)
    return round(red), round(green), round(blue)


def _without_drag(frame: Frame) -> tuple[Array, Array]:
    """Forces and torques (15, 3) from outside without a drag's, which has an arrow of its own, and without
    small ones."""
    forces, torques = frame.loads.copy(), frame.torques.copy()
    if frame.drag is not None and frame.dragged is not None:
        forces[frame.dragged] -= frame.drag[2]
        torques[frame.dragged] = 0.0
    forces[np.linalg.norm(forces, axis=-1) < MIN_FORCE] = 0.0
    torques[np.linalg.norm(torques, axis=-1) < MIN_TORQUE] = 0.0
    return forces, torques


def _outside(bodies: BodyStates, vectors: Array) -> Array:
    """Where lines from the centres of bodies along `vectors` (15, 3) leave them (15, 3): a short arrow that
    begins at the centre cannot be seen. A body counts as the box around it."""
    length = np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)
    along = np.abs(rotate(conjugate(bodies.rotations), vectors / length))
    reach = np.min(_HALF / np.maximum(along, 1e-9), axis=-1, keepdims=True)
    found: Array = bodies.positions + np.minimum(reach, 1.0) * vectors / length
    return found


def _point(arrows: Any, root: Array, starts: Array, vectors: Array) -> None:
    """Arrows (N, 3) from points (N, 3); none that is shorter than a centimetre.

    A browser takes longer to exchange points than to move a node. The node moves with the humanoid's root
    (3,), so that arrows that are late are still on their bodies.
    """
    shown, starts = np.linalg.norm(vectors, axis=-1) > 0.01, starts - root
    arrows.position = tuple(root)
    arrows.points = np.stack([starts[shown], (starts + vectors)[shown]], axis=1) if shown.any() else _HIDDEN


def _place(nodes: Sequence[Any], bodies: BodyStates) -> None:
    for node, position, rotation in zip(nodes, bodies.positions, bodies.rotations, strict=True):
        node.position, node.wxyz = tuple(position), tuple(rotation[[3, 0, 1, 2]])


def _mesh(shape: str, size: Sequence[float], count: tuple[int, int] = (12, 12)) -> Any:
    """A collision shape about its centre; an ellipsoid of Table 1 is simulated as a capsule, with `count`
    vertices around and along it."""
    if shape == "box":
        return trimesh.creation.box(extents=size)
    radius = 0.5 * size[0]
    height = max(size[2] - size[0], 1e-4)
    mesh = trimesh.creation.capsule(height=height, radius=radius, count=count)
    mesh.apply_translation(-mesh.bounds.mean(axis=0))
    return mesh


def _obstacle_mesh(obstacle: Obstacle) -> Any:
    if obstacle.shape == "box":
        return trimesh.creation.box(extents=obstacle.size)
    if obstacle.shape == "sphere":
        return trimesh.creation.icosphere(subdivisions=2, radius=0.5 * obstacle.size[0])
    return trimesh.creation.cylinder(radius=0.5 * obstacle.size[0], height=obstacle.size[2])
