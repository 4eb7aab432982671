"""The page of a session: a browser's clicks and drags become inputs, frames become pictures.

viser calls back on its own thread. Callbacks only put inputs into a bounded queue, which the thread of the
simulation empties before every control step; viser alone handles browsers that are slow or gone.
"""

from __future__ import annotations

import io
import queue
import threading
import time
from collections.abc import Callable
from contextlib import redirect_stdout
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import viser

from kinemimic.evaluate.simulate.page.controls import Actions, Choices, Controls
from kinemimic.evaluate.simulate.page.guard import HOST, Guard, free_port, guarded, never_share
from kinemimic.evaluate.simulate.page.requests import Request
from kinemimic.evaluate.simulate.page.stage import Stage
from kinemimic.evaluate.simulate.session.frame import Frame, Status
from kinemimic.evaluate.simulate.session.inputs import Drag, Input, Release, finite
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.rotations import conjugate, rotate
from kinemimic.retarget.humanoid.body import BODIES, BODY_INDEX

MAX_WAITING = 256  # inputs
CAMERA, LOOK_AT = (2.6, -3.0, 1.6), (0.0, 0.0, 0.9)
# On a phone viser's panel has the lower three fifths: looking lower puts the humanoid above it. The shape
# tells a phone from a tablet; the number of pixels depends on the screen's density.
NARROW, LOOK_BELOW = 0.65, (0.0, 0.0, -0.95)  # width by height, m
NOTICE = 3.0  # s that a refusal is shown; none follows it within them


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
    KinemimicError without a free port.
    """

    def __init__(self, port: int, token: str, choices: Choices) -> None:
        self.waiting: queue.Queue[Input | Request] = queue.Queue(MAX_WAITING)
        self._holder: int | None = None
        self._notes: dict[int, Any] = {}  # of the viewers, who has the controls
        self._noticed: dict[int, float] = {}  # when a viewer was refused, s
        self._last: Frame | None = None
        self._pull: _Pull | None = None
        # Between a pull and its queued drags: a drag behind its release would last forever.
        self._lock = threading.Lock()
        port = free_port(port)
        # viser prints a box with an address that lacks the token.
        with guarded(token) as guard, redirect_stdout(io.StringIO()):
            self._server = viser.ViserServer(host=HOST, port=port, label="kinemimic", verbose=False)
        never_share(self._server)
        self._guard: Guard = guard
        self._stage = Stage(self._server)
        actions = Actions(allowed=self._allowed, send=self._offer, take_control=self._hold, say=self._say)
        self.controls = Controls(self._server, choices, actions)
        for body, node in zip(BODIES, self._stage.bodies, strict=True):
            node.on_drag("left")(self._dragged(body.name))
        self._server.on_client_connect(self._connected)
        self._server.on_client_disconnect(self._left)

    @property
    def address(self) -> str:
        """Where to open the page."""
        return f"http://{HOST}:{self._server.get_port()}/?token={self._guard.token}"

    # Coroutines, for the same reason as the callbacks of the panel.
    async def _connected(self, client: viser.ClientHandle) -> None:
        narrow = client.camera.aspect <= NARROW
        client.camera.position, client.camera.look_at = CAMERA, LOOK_BELOW if narrow else LOOK_AT
        self._notes[client.client_id] = self.controls.note(client)
        self._hold(client.client_id if self._holder is None else self._holder)

    async def _left(self, client: viser.ClientHandle) -> None:
        self._notes.pop(client.client_id, None)
        self._noticed.pop(client.client_id, None)
        left = self._holder == client.client_id
        self._hold(min(self._notes, default=None) if left else self._holder)

    def _hold(self, client: int | None) -> None:
        """Give a viewer the controls, and tell all who has them."""
        if self._holder not in (None, client):
            with self._lock:
                self._pull = None  # its viewer may have gone in the middle of a drag
                self._offer(Release())
        self._holder = client
        for viewer, note in self._notes.items():
            who = "you have" if viewer == client else "another viewer has"
            note.content = f"{len(self._notes)} viewers; {who} the controls" if len(self._notes) > 1 else ""

    def _allowed(self, client: int) -> bool:
        """Whether a viewer holds the controls; it is told if not."""
        if client == self._holder:
            return True
        now = time.monotonic()
        if now - self._noticed.get(client, -NOTICE) >= NOTICE:
            self._noticed[client] = now
            self._say(client, "Press “Take control” first.", title="Another viewer holds the controls")
        return False

    def _say(self, client: int, text: str, *, title: str = "kinemimic") -> None:
        if (viewer := self._server.get_clients().get(client)) is not None:
            viewer.add_notification(title, text, auto_close_seconds=NOTICE)

    def _offer(self, event: Input | Request) -> None:
        try:
            self.waiting.put_nowait(event)
        except queue.Full:
            if isinstance(event, Release):  # the one input that must not be lost
                self.waiting.queue.clear()
                self.waiting.put_nowait(event)

    def _dragged(self, body: str) -> Callable[[Any], Any]:
        index = BODY_INDEX[body]

        async def dragged(event: Any) -> None:
            frame, client = self._last, event.client_id
            if client != self._holder:
                if event.phase == "start":
                    self._allowed(client)
                return
            if event.phase == "end":
                with self._lock:
                    self._pull = None
                    self._offer(Release())
                return
            if frame is None or not finite(*event.start_position, *event.end_position):
                return
            pointer = np.array(event.end_position)
            with self._lock:
                if event.phase == "start":
                    start = self._stage.in_session(np.array(event.start_position))
                    arm = start - frame.bodies.positions[index]
                    grab = rotate(conjugate(frame.bodies.rotations[index]), arm)
                    self._pull = _Pull(client, body, grab, pointer)
                elif self._pull is not None and self._pull.client == client:
                    self._pull = replace(self._pull, pointer=pointer)

        return dragged

    def _pulled(self) -> None:
        """Queue a drag for the next control step. The pointer rests on the screen, which follows."""
        with self._lock:
            pull = self._pull
            if pull is None:
                return
            gx, gy, gz = np.clip(pull.grab, -5.0, 5.0).tolist()
            x, y, z = np.clip(self._stage.in_session(pull.pointer), -1e4, 1e4).tolist()
            stiffness, limit = float(self.controls.stiffness.value), float(self.controls.limit.value)
            self._offer(Drag(pull.body, (gx, gy, gz), (x, y, z), stiffness, limit))

    def draw(self, frame: Frame) -> None:
        """Show a frame."""
        self._last = frame
        self._pulled()
        self._stage.follow = bool(self.controls.follow.value)
        if (wanted := bool(self.controls.ghost.value)) != self._stage.ghost_visible:
            self._stage.ghost_visible = wanted
        self.controls.take(frame)
        self._stage.draw(frame)

    def show(self, frame: Frame, status: Status) -> None:
        """Show numbers and curves."""
        self.controls.show(frame, status)

    def tell(self, error: KinemimicError | str) -> None:
        """A message for all viewers."""
        for client in self._server.get_clients().values():
            client.add_notification("kinemimic", str(error)[:500], auto_close_seconds=6.0)

    def viewers(self) -> int:
        """How many browsers are connected."""
        return len(self._server.get_clients())

    def close(self) -> None:
        """End the server."""
        with redirect_stdout(io.StringIO()):
            self._server.stop()
