"""Clicks and drags of viewers, as viser's events, without a browser."""

from __future__ import annotations

import asyncio
import inspect
import socket
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from kinemimic.evaluate.simulate.controls import Choices
from kinemimic.evaluate.simulate.frame import PAUSED, RECORDING
from kinemimic.evaluate.simulate.guard import HOST, free_port
from kinemimic.evaluate.simulate.inputs import Carry, Drag, Push, Release
from kinemimic.evaluate.simulate.page import Page
from kinemimic.pipeline.errors import KinemimicError

viser = pytest.importorskip("viser")
HOLDER, OTHER = 1, 2
CHOICES = Choices(("mine", "run", "tracker"), ("mine", "run"), (), "mine", "mine", ("tracker",))


@pytest.fixture(scope="module")
def served() -> Iterator[Page]:
    page = Page(18_190, "token", CHOICES)
    yield page
    page.close()


@pytest.fixture
def page(served: Page, monkeypatch: pytest.MonkeyPatch) -> Page:
    """A page of which viewer 1 holds the controls, and which keeps what it says."""
    while not served.waiting.empty():
        served.waiting.get()
    said: list[tuple[int, str]] = []

    def heard(client: int, text: str, *, title: str = "") -> None:
        said.append((client, title or text))

    monkeypatch.setattr(served, "_say", heard)
    monkeypatch.setattr(served.controls, "_act", replace(served.controls._act, say=heard))
    served.said = said  # type: ignore[attr-defined]
    served._holder, served._pull = HOLDER, None
    served._notes, served._noticed = {}, {}
    still = SimpleNamespace(positions=np.zeros((15, 3)), rotations=np.tile([0.0, 0.0, 0.0, 1.0], (15, 1)))
    served._last = SimpleNamespace(bodies=still)  # type: ignore[assignment]
    return served


def waiting(page: Page) -> list[Any]:
    return [page.waiting.get_nowait() for _ in range(page.waiting.qsize())]


def inputs(page: Page) -> dict[str, Any]:
    """The panel's buttons, sliders and lists by their labels."""
    handles = page._server.gui._gui_input_handle_from_uuid.values()
    return {str(handle.label): handle for handle in handles if hasattr(handle, "label")}


def tell(page: Page, client: int, label: str, value: Any = None) -> None:
    """What viser does with a click or with a changed value, and then its callbacks."""
    handle = inputs(page)[label]
    if value is not None:
        handle._impl.value = value
    for callback in handle._impl.update_cb:
        asyncio.run(callback(SimpleNamespace(client_id=client)))


def drag(page: Page, client: int, phase: str, pointer: tuple[float, float, float] = (1.0, 0.0, 1.0)) -> None:
    event = SimpleNamespace(
        client_id=client, phase=phase, start_position=(0.0, 0.1, 0.0), end_position=pointer
    )
    asyncio.run(page._dragged("torso")(event))


def test_viser_runs_every_callback_of_the_panel_in_order(page: Page) -> None:
    callbacks = [one for handle in inputs(page).values() for one in handle._impl.update_cb]
    assert len(callbacks) > 30
    assert all(map(inspect.iscoroutinefunction, callbacks))


def test_a_drag_begins_moves_and_ends(page: Page) -> None:
    drag(page, HOLDER, "start")
    drag(page, HOLDER, "update", (2.0, 0.0, 1.0))
    page._pulled()
    drag(page, HOLDER, "end")
    page._pulled()
    found = waiting(page)
    assert [type(one) for one in found] == [Drag, Release]
    assert found[0].grab == pytest.approx((0.0, 0.1, 0.0))
    assert found[0].pointer == pytest.approx((2.0, 0.0, 1.0))


def test_no_drag_comes_between_the_end_of_a_pull_and_its_release(page: Page) -> None:
    drag(page, HOLDER, "start")
    offer, queued = page._offer, list[str]()

    def watched(event: Any) -> None:
        queued.append(type(event).__name__)
        assert page._lock.locked()
        offer(event)

    page._offer = watched  # type: ignore[method-assign]
    try:
        page._pulled()
        drag(page, HOLDER, "end")
        page._pulled()
    finally:
        page._offer = offer  # type: ignore[method-assign]
    assert queued == ["Drag", "Release"]


def test_a_viewer_without_the_controls_neither_breaks_a_drag_nor_is_flooded(page: Page) -> None:
    drag(page, HOLDER, "start")
    for phase in ("start", "update", "update", "end"):
        drag(page, OTHER, phase)
    tell(page, OTHER, "Restart")
    page._pulled()
    assert [type(one) for one in waiting(page)] == [Drag]
    assert page.said == [(OTHER, "Another viewer holds the controls")]  # type: ignore[attr-defined]


def test_a_drag_of_who_then_takes_the_controls_waits_for_its_next_start(page: Page) -> None:
    drag(page, OTHER, "start")
    tell(page, OTHER, "Take control")
    drag(page, OTHER, "update")
    page._pulled()
    assert [type(one) for one in waiting(page)] == [Release]


def test_a_viewer_without_the_controls_changes_no_slider(page: Page) -> None:
    tell(page, HOLDER, "Force, N", 50)
    tell(page, OTHER, "Force, N", 500)
    tell(page, OTHER, "Show reference", value=False)
    tell(page, OTHER, "Weight in the hand, kg", 10.0)
    assert (inputs(page)["Force, N"].value, page.controls.ghost.value) == (50, True)
    tell(page, HOLDER, "Forward")
    tell(page, HOLDER, "Weight in the hand, kg", 2.0)
    push, carry = waiting(page)
    assert isinstance(push, Push)
    assert push.force == (50.0, 0.0, 0.0)
    assert carry == Carry("hand_left", 2.0)
    tell(page, HOLDER, "Weight in the hand, kg", 0.0)


def test_a_checkbox_asks_for_a_picture(page: Page) -> None:
    tell(page, HOLDER, "Camera follows", value=False)
    tell(page, HOLDER, "Camera follows", value=True)
    assert waiting(page) == [("look", ())] * 2


def test_a_policy_of_one_motion_says_so_and_sets_the_list_back(page: Page) -> None:
    for policy, motion, performed, said in (
        ("run", "mine", "run", 1),
        ("tracker", "mine", "mine", 0),
        ("mine", "mine", "mine", 0),
    ):
        page.said.clear()  # type: ignore[attr-defined]
        tell(page, HOLDER, "Policy", policy)
        tell(page, HOLDER, "Motion", motion)
        tell(page, HOLDER, "Change policy and motion")
        assert waiting(page) == [("choose", (policy, performed, 1.0))]
        assert inputs(page)["Motion"].value == performed
        assert len(page.said) == said  # type: ignore[attr-defined]


def test_viewers_see_who_has_the_controls(page: Page) -> None:
    page._notes = {client: SimpleNamespace(content="") for client in (HOLDER, OTHER)}
    page._hold(OTHER)
    assert page._notes[OTHER].content == "2 viewers; you have the controls"
    assert page._notes[HOLDER].content == "2 viewers; another viewer has the controls"
    asyncio.run(page._left(SimpleNamespace(client_id=OTHER)))  # type: ignore[arg-type]
    assert (page._holder, page._notes[HOLDER].content) == (HOLDER, "")
    assert [type(one) for one in waiting(page)] == [Release, Release]


def test_buttons_say_what_a_click_does_and_curves_begin_again(page: Page) -> None:
    controls = page.controls
    names = ("knee_left", "hip_left")

    def frame(step: int) -> Any:
        bodies = SimpleNamespace(positions=np.zeros((15, 3)))
        angles = dict.fromkeys(names, 0.1)
        return SimpleNamespace(step=step, wanted=angles, angles=angles, terms={}, bodies=bodies)

    for step in (5, 6, 6):
        controls.take(frame(step))
    assert [row[0] for row in controls._rows] == pytest.approx([5 / 30, 6 / 30])
    controls.show(frame(6), f"{RECORDING} here\n\n**a** performs **b**: {PAUSED}, 0 falls")
    assert (controls._pause.label, controls._recorder.label) == ("Resume", "Stop recording")
    controls.show(frame(6), "**a** performs **b**: upright, 0 falls")
    assert (controls._pause.label, controls._recorder.label) == ("Pause", "Record")
    controls.take(frame(1))
    assert len(controls._rows) == 1


def test_no_browser_can_ask_for_a_tunnel_to_a_server_elsewhere(page: Page) -> None:
    handled = {one.__name__ for one in page._server._websock_server._incoming_handlers}
    assert "GuiUpdateMessage" in handled
    assert not [name for name in handled if "Share" in name]


def test_the_next_free_port_is_taken_and_the_last_one_ends_the_search() -> None:
    with socket.socket() as taken, socket.socket() as last:
        taken.bind((HOST, 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert port < free_port(port) <= port + 100
        with suppress(OSError):  # it is taken already
            last.bind((HOST, 65_535))
            last.listen()
        with pytest.raises(KinemimicError, match=r"expected a free port of 127.0.0.1 from 65535 on"):
            free_port(65_535)


def test_what_a_live_capture_does_not_let_choose_has_no_controls() -> None:
    live = Page(
        18_191, "token", Choices(("mine",), ("live",), (), "mine", "live", phases=False, slower=False)
    )
    try:
        labels = inputs(live).keys()
        assert {"Pause", "Restart", "Record", "Camera follows", "Friction"} <= labels
        assert not labels & {
            "Policy", "Motion", "Speed of the motion", "Change policy and motion", "Start phase", "Scenario",
            "Trial", "Start the scenario", "Playback speed",
        }  # fmt: skip
        tell(live, HOLDER, "Pause")
    finally:
        live.close()
