"""Drives the page of `simulate` without a browser, through private parts that only this module knows."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from kinemimic.evaluate.simulate.page.page import Page
from kinemimic.evaluate.simulate.session.frame import Frame


class Panel:
    """A page whose viewers click and drag here, and which keeps what it says; nobody holds its controls.

    said: client and title, or text without one.
    """

    def __init__(self, page: Page) -> None:
        self.page, self.controls = page, page.controls
        self.said: list[tuple[int, str]] = []
        page._say = self._heard  # type: ignore[method-assign]
        page.controls._act = replace(page.controls._act, say=self._heard)
        self.reset(None)

    def _heard(self, client: int, text: str, *, title: str = "") -> None:
        self.said.append((client, title or text))

    def reset(self, holder: int | None) -> None:
        """Forget viewers, drags, inputs and what was said; this viewer then holds the controls."""
        self.waiting()
        self.said.clear()
        self.page._holder, self.page._pull = holder, None
        self.page._notes, self.page._noticed = {}, {}
        still = SimpleNamespace(positions=np.zeros((15, 3)), rotations=np.tile([0.0, 0.0, 0.0, 1.0], (15, 1)))
        self.page._last = SimpleNamespace(bodies=still)  # type: ignore[assignment]

    def waiting(self) -> list[Any]:
        """The inputs that the page has queued."""
        return [self.page.waiting.get_nowait() for _ in range(self.page.waiting.qsize())]

    def inputs(self) -> dict[str, Any]:
        """The buttons, sliders and lists by their labels."""
        handles = self.page._server.gui._gui_input_handle_from_uuid.values()
        return {str(handle.label): handle for handle in handles if hasattr(handle, "label")}

    def callbacks(self) -> list[Callable[..., Any]]:
        """What viser calls when any of the inputs changes."""
        return [one for handle in self.inputs().values() for one in handle._impl.update_cb]

    def draw(self, frame: Frame) -> None:
        """Draw a frame, without its numbers and curves."""
        self.page._stage.draw(frame)

    def companions(self) -> Any:
        """Positions (N, 15, 3) of the bodies of the companions that are seen, None if nobody is."""
        nodes = self.page._stage._companions
        if not any(node.visible for node in nodes):
            return None
        return np.stack([node.batched_positions + node.position for node in nodes], axis=1)

    def handled_messages(self) -> set[str]:
        """Names of the browser's messages that viser handles."""
        return {one.__name__ for one in self.page._server._websock_server._incoming_handlers}

    def tell(self, client: int, label: str, value: Any = None) -> None:
        """What viser does with a click or with a changed value, and then its callbacks."""
        handle = self.inputs()[label]
        if value is not None:
            handle._impl.value = value
        for callback in handle._impl.update_cb:
            asyncio.run(callback(SimpleNamespace(client_id=client)))

    def drag(self, client: int, phase: str, pointer: tuple[float, float, float] = (1.0, 0.0, 1.0)) -> None:
        """A phase of a drag of the torso."""
        event = SimpleNamespace(
            client_id=client, phase=phase, start_position=(0.0, 0.1, 0.0), end_position=pointer
        )
        asyncio.run(self.page._dragged("torso")(event))

    def pulled(self) -> None:
        """What the page does with a drag before every control step."""
        self.page._pulled()

    @contextmanager
    def offers(self) -> Iterator[list[tuple[str, bool]]]:
        """What the page queues within the block: its kind, and whether drags were locked."""
        offer, queued = self.page._offer, list[tuple[str, bool]]()

        def watched(event: Any) -> None:
            queued.append((type(event).__name__, self.page._lock.locked()))
            offer(event)

        self.page._offer = watched  # type: ignore[method-assign]
        try:
            yield queued
        finally:
            self.page._offer = offer  # type: ignore[method-assign]

    def connect(self, viewers: Sequence[int]) -> None:
        """These viewers, without browsers."""
        self.page._notes = {client: SimpleNamespace(content="") for client in viewers}

    def hold(self, client: int) -> None:
        """A viewer takes the controls."""
        self.page._hold(client)

    def leave(self, client: int) -> None:
        """A viewer closes its browser."""
        asyncio.run(self.page._left(SimpleNamespace(client_id=client)))  # type: ignore[arg-type]

    @property
    def holder(self) -> int | None:
        """Who has the controls."""
        return self.page._holder

    def note(self, client: int) -> str:
        """What a viewer reads about the controls."""
        return str(self.page._notes[client].content)

    def curve_times(self) -> list[float]:
        """Seconds of the frames that the curves show."""
        return [row[0] for row in self.controls._rows]

    def labels(self) -> tuple[str, str]:
        """Of the buttons that pause and record."""
        return self.controls._pause.label, self.controls._recorder.label
