"""Clicks and drags of viewers, as viser's events, without a browser."""

from __future__ import annotations

import inspect
import socket
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from peers.panel import Panel

from kinemimic.evaluate.simulate.page.controls import Choices
from kinemimic.evaluate.simulate.page.guard import HOST, free_port
from kinemimic.evaluate.simulate.page.page import Page
from kinemimic.evaluate.simulate.page.requests import Choose, Redraw
from kinemimic.evaluate.simulate.session.frame import Status
from kinemimic.evaluate.simulate.session.inputs import Carry, Drag, Enter, Push, Release
from kinemimic.evaluate.simulate.session.recording import begin_session
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.train.scenario.scenario_file import find_scenario

pytest.importorskip("viser")
HOLDER, OTHER = 1, 2
CHOICES = Choices(("mine", "run", "tracker"), ("mine", "run"), (), "mine", "mine", ("tracker",))


@pytest.fixture(scope="module")
def served() -> Iterator[Panel]:
    page = Page(18_190, "token", CHOICES)
    yield Panel(page)
    page.close()


@pytest.fixture
def panel(served: Panel) -> Panel:
    """A page of which viewer 1 holds the controls, and which keeps what it says."""
    served.reset(HOLDER)
    return served


def test_viser_runs_every_callback_of_the_panel_in_order(panel: Panel) -> None:
    callbacks = panel.callbacks()
    assert len(callbacks) > 30
    assert all(map(inspect.iscoroutinefunction, callbacks))


def test_a_drag_begins_moves_and_ends(panel: Panel) -> None:
    panel.drag(HOLDER, "start")
    panel.drag(HOLDER, "update", (2.0, 0.0, 1.0))
    panel.pulled()
    panel.drag(HOLDER, "end")
    panel.pulled()
    found = panel.waiting()
    assert [type(one) for one in found] == [Drag, Release]
    assert found[0].grab == pytest.approx((0.0, 0.1, 0.0))
    assert found[0].pointer == pytest.approx((2.0, 0.0, 1.0))


def test_no_drag_comes_between_the_end_of_a_pull_and_its_release(panel: Panel) -> None:
    panel.drag(HOLDER, "start")
    with panel.offers() as queued:
        panel.pulled()
        panel.drag(HOLDER, "end")
        panel.pulled()
    assert queued == [("Drag", True), ("Release", True)]


def test_a_viewer_without_the_controls_neither_breaks_a_drag_nor_is_flooded(panel: Panel) -> None:
    panel.drag(HOLDER, "start")
    for phase in ("start", "update", "update", "end"):
        panel.drag(OTHER, phase)
    panel.tell(OTHER, "Restart")
    panel.pulled()
    assert [type(one) for one in panel.waiting()] == [Drag]
    assert panel.said == [(OTHER, "Another viewer holds the controls")]


def test_a_drag_of_who_then_takes_the_controls_waits_for_its_next_start(panel: Panel) -> None:
    panel.drag(OTHER, "start")
    panel.tell(OTHER, "Take control")
    panel.drag(OTHER, "update")
    panel.pulled()
    assert [type(one) for one in panel.waiting()] == [Release]


def test_a_viewer_without_the_controls_changes_no_slider(panel: Panel) -> None:
    panel.tell(HOLDER, "Force, N", 50)
    panel.tell(OTHER, "Force, N", 500)
    panel.tell(OTHER, "Show reference", value=False)
    panel.tell(OTHER, "Weight in the hand, kg", 10.0)
    assert (panel.inputs()["Force, N"].value, panel.controls.ghost.value) == (50, True)
    panel.tell(HOLDER, "Forward")
    panel.tell(HOLDER, "Weight in the hand, kg", 2.0)
    push, carry = panel.waiting()
    assert isinstance(push, Push)
    assert push.force == (50.0, 0.0, 0.0)
    assert carry == Carry("hand_left", 2.0)
    panel.tell(HOLDER, "Weight in the hand, kg", 0.0)


def test_a_checkbox_asks_for_a_picture(panel: Panel) -> None:
    panel.tell(HOLDER, "Camera follows", value=False)
    panel.tell(HOLDER, "Camera follows", value=True)
    assert panel.waiting() == [Redraw()] * 2


def test_a_policy_of_one_motion_says_so_and_sets_the_list_back(panel: Panel) -> None:
    for policy, motion, performed, said in (
        ("run", "mine", "run", 1),
        ("tracker", "mine", "mine", 0),
        ("mine", "mine", "mine", 0),
    ):
        panel.said.clear()
        panel.tell(HOLDER, "Policy", policy)
        panel.tell(HOLDER, "Motion", motion)
        panel.tell(HOLDER, "Change policy and motion")
        assert panel.waiting() == [Choose(policy, performed, 1.0)]
        assert panel.inputs()["Motion"].value == performed
        assert len(panel.said) == said


def test_viewers_see_who_has_the_controls(panel: Panel) -> None:
    panel.connect((HOLDER, OTHER))
    panel.hold(OTHER)
    assert panel.note(OTHER) == "2 viewers; you have the controls"
    assert panel.note(HOLDER) == "2 viewers; another viewer has the controls"
    panel.leave(OTHER)
    assert (panel.holder, panel.note(HOLDER)) == (HOLDER, "")
    assert [type(one) for one in panel.waiting()] == [Release, Release]


def test_companions_are_drawn_and_disappear_in_a_scenario(panel: Panel, walk_run: Path) -> None:
    session = begin_session(walk_run, "pybullet", companions=3, named=find_scenario)
    frame = session.advance()
    panel.draw(frame)
    assert frame.companions is not None
    np.testing.assert_allclose(panel.companions(), frame.companions.positions, atol=1e-5)
    session.apply(Enter("thrown-ball"))
    panel.draw(session.advance())
    assert panel.companions() is None
    session.close()


def test_buttons_say_what_a_click_does_and_curves_begin_again(panel: Panel) -> None:
    controls = panel.controls
    names = ("knee_left", "hip_left")

    def frame(step: int) -> Any:
        bodies = SimpleNamespace(positions=np.zeros((15, 3)))
        angles = dict.fromkeys(names, 0.1)
        return SimpleNamespace(step=step, wanted=angles, angles=angles, terms={}, bodies=bodies)

    for step in (5, 6, 6):
        controls.take(frame(step))
    assert panel.curve_times() == pytest.approx([5 / 30, 6 / 30])
    controls.show(frame(6), Status("0 falls", paused=True, recording=True))
    assert panel.labels() == ("Resume", "Stop recording")
    controls.show(frame(6), Status("1 fall"))
    assert controls.status.content == "1 fall"
    assert panel.labels() == ("Pause", "Record")
    controls.take(frame(1))
    assert len(panel.curve_times()) == 1


def test_no_browser_can_ask_for_a_tunnel_to_a_server_elsewhere(panel: Panel) -> None:
    handled = panel.handled_messages()
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
    panel = Panel(live)
    panel.reset(HOLDER)
    try:
        labels = panel.inputs().keys()
        assert {"Pause", "Restart", "Record", "Camera follows", "Friction"} <= labels
        assert not labels & {
            "Policy", "Motion", "Speed of the motion", "Change policy and motion", "Start phase", "Scenario",
            "Trial", "Start the scenario", "Playback speed",
        }  # fmt: skip
        panel.tell(HOLDER, "Pause")
    finally:
        live.close()
