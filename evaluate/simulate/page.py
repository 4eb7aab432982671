"""The page of a session: a browser's clicks and drags become inputs, frames become pictures.

viser calls back on its own thread. Callbacks only put inputs into a bounded queue, which the thread of the
simulation empties before every control step; a slow or gone browser is viser's business alone.
"""

from __future__ import annotations

import io
import queue
import threading
from collections.abc import Callable
from contextlib import redirect_stdout
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import viser

from kinemimic.evaluate.simulate.controls import Actions, Choices, Controls
from kinemimic.evaluate.simulate.frame import Frame
from kinemimic.evaluate.simulate.guard import HOST, Guard, guarded
from kinemimic.evaluate.simulate.inputs import Drag, Input, Release, finite
from kinemimic.evaluate.simulate.stage import Stage
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.rotations import conjugate, rotate
from kinemimic.retarget.humanoid.body import BODIES, BODY_INDEX

MAX_WAITING = 256  # inputs
CAMERA, LOOK_AT = (2.6, -3.0, 1.6), (0.0, 0.0, 0.9)
# On a phone viser's panel has the lower three fifths: looking lower puts the humanoid above it. The shape
# tells a phone from a tablet; the number of pixels depends on the screen's density.
NARROW, LOOK_BELOW = 0.65, (0.0, 0.0, -0.95)  # width by height, m
# What a person asks for beside inputs: its name and arguments.
Request = tuple[Literal["toggle", "step", "speed", "choose", "record"], tuple[Any, ...]]


@dataclass(frozen=True)
class _Pull:
    """A drag by a viewer: a body, the grabbed point in its frame, the pointer in the frame of the scene."""

    client: int
    body: str
    grab: Array
    pointer: Array


class Page:
    """Serves a session on 127.0.0.1; `address` has the token.

    One viewer at a time holds the controls: the first one, until another takes them or it leaves.
    """

    def __init__(self, port: int, token: str, choices: Choices) -> None:
        self.waiting: queue.Queue[Input | Request] = queue.Queue(MAX_WAITING)
        self._holder: int | None = None
        self._last: Frame | None = None
        self._pull: _Pull | None = None
        self._lock = threading.Lock()
        # viser prints a box with an address that lacks the token.
        with guarded(token) as guard, redirect_stdout(io.StringIO()):
            self._server = viser.ViserServer(host=HOST, port=port, label="kinemimic", verbose=False)
        self._guard: Guard = guard
        self._stage = Stage(self._server)
        actions = Actions(
            send=lambda event, found: self._put(event.client_id, found),
            toggle=self._asks("toggle"),
            one_step=self._asks("step"),
            slower=lambda event, speed: self._put(event.client_id, ("speed", (speed,))),
            choose=lambda event, *chosen: self._put(event.client_id, ("choose", chosen)),
            record=self._asks("record"),
            take_control=lambda event: self._hold(event.client_id),
        )
        self.controls = Controls(self._server, choices, actions)
        for body, node in zip(BODIES, self._stage.bodies, strict=True):
            node.on_drag("left")(self._dragged(body.name))
        self._server.on_client_connect(self._connected)
        self._server.on_client_disconnect(self._left)

    @property
    def address(self) -> str:
        """Where to open the page."""
        return f"http://{HOST}:{self._server.get_port()}/?token={self._guard.token}"

    def _connected(self, client: viser.ClientHandle) -> None:
        narrow = client.camera.aspect <= NARROW
        client.camera.position, client.camera.look_at = CAMERA, LOOK_BELOW if narrow else LOOK_AT
        with self._lock:
            if self._holder is None:
                self._holder = client.client_id

    def _left(self, client: viser.ClientHandle) -> None:
        with self._lock:
            if self._holder == client.client_id:
                self._holder = min(
                    (one for one in self._server.get_clients() if one != client.client_id), default=None
                )
                self._pull = None  # it may have gone in the middle of a drag
                self._offer(Release())

    def _hold(self, client: int | None) -> None:
        with self._lock:
            if self._holder != client:
                self._pull = None
                self._offer(Release())
            self._holder = client

    def _asks(self, name: Any) -> Callable[[viser.GuiEvent[Any]], None]:
        return lambda event: self._put(event.client_id, (name, ()))

    def _put(self, client: int | None, found: Input | Request) -> None:
        """Queue what a viewer did if it holds the controls; say so if not."""
        if client is not None and client != self._holder:
            self._pull = None
            if (viewer := self._server.get_clients().get(client)) is not None:
                viewer.add_notification(
                    "Another viewer holds the controls",
                    "Press “Take control” first.",
                    auto_close_seconds=3.0,
                )
            return
        self._offer(found)

    def _offer(self, found: Input | Request) -> None:
        try:
            self.waiting.put_nowait(found)
        except queue.Full:
            if isinstance(found, Release):  # the one input that must not be lost
                self.waiting.queue.clear()
                self.waiting.put_nowait(found)

    def _dragged(self, body: str) -> Callable[[Any], Any]:
        index = BODY_INDEX[body]

        # A coroutine: viser runs plain functions out of order.
        async def dragged(event: Any) -> None:
            frame, client = self._last, event.client_id
            if event.phase == "end" or frame is None:
                self._pull = None
                self._put(client, Release())
                return
            if not finite(*event.start_position, *event.end_position):
                return
            pull = self._pull
            if pull is None or pull.client != client:
                arm = self._stage.in_session(np.array(event.start_position)) - frame.bodies.positions[index]
                grab = rotate(conjugate(frame.bodies.rotations[index]), arm)
                pull = _Pull(client, body, grab, np.zeros(3))
            self._pull = replace(pull, pointer=np.array(event.end_position))

        return dragged

    def _pulled(self) -> None:
        """Queue a drag for the next control step. The pointer rests on the screen, which follows."""
        pull = self._pull
        if pull is None:
            return
        gx, gy, gz = np.clip(pull.grab, -5.0, 5.0).tolist()
        x, y, z = np.clip(self._stage.in_session(pull.pointer), -1e4, 1e4).tolist()
        stiffness, limit = float(self.controls.stiffness.value), float(self.controls.limit.value)
        self._put(pull.client, Drag(pull.body, (gx, gy, gz), (x, y, z), stiffness, limit))

    def draw(self, frame: Frame) -> None:
        """Show a frame."""
        self._last = frame
        self._pulled()
        self._stage.follow = bool(self.controls.follow.value)
        if (wanted := bool(self.controls.ghost.value)) != self._stage.ghost_visible:
            self._stage.ghost_visible = wanted
        self.controls.take(frame)
        self._stage.draw(frame)

    def show(self, frame: Frame, state: str) -> None:
        """Show numbers and curves."""
        self.controls.show(frame, state)

    def tell(self, error: KinemimicError | str) -> None:
        """A message for all viewers."""
        for client in self._server.get_clients().values():
            client.add_notification("kinemimic", str(error)[:500], auto_close_seconds=6.0)

    def close(self) -> None:
        """End the server."""
        with redirect_stdout(io.StringIO()):
            self._server.stop()
