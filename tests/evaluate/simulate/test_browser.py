"""The page in a real browser: drags, buttons, two viewers, reloads; no request leaves this machine."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from peers.browser import CHROMIUM, Watched, chromium, served

pytest.importorskip("playwright.sync_api")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="needs the browser chromium"),
]


@pytest.fixture(scope="module")
def address(walk_run: Path) -> Iterator[str]:
    with served("simulate", "--run", str(walk_run), "--port", "18091") as found:
        yield found


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as one:
        yield one


def inputs(folder: Path) -> list[dict[str, Any]]:
    lines = [json.loads(line) for line in (folder / "session.jsonl").read_text().splitlines()]
    return [line["input"] for line in lines if "input" in line]


def drag(watched: Watched, folder: Path, *, release: bool = True) -> None:
    """Drag what stands in the middle of the scene, once that is drawn: software rendering takes seconds."""
    mouse = watched.tab.mouse
    x, y = 340, 325
    for _ in range(10):
        time.sleep(1.5)
        mouse.move(x, y)
        mouse.down()
        for k in range(15):
            mouse.move(x + 4 * k, y - k)
            time.sleep(0.06)
        if any(one["type"] == "drag" for one in inputs(folder)):
            break
        mouse.up()
    if release:
        mouse.up()
        time.sleep(0.5)


def test_people_push_it_and_a_recording_shows_it(browser: Any, address: str, walk_run: Path) -> None:
    first = Watched(browser, address)
    first.press("Record")
    first.sees("recording into")
    drag(first, walk_run / "simulate" / "session-1")
    first.open("Push")
    for name in (
        "Forward", "Backward", "Left", "Right", "100 N on a thigh", "30 N·m on an arm",
        "Throw a ball at the chest", "Throw a ball from the side", "Box of knee height ahead",
        "Post of hip height ahead", "Clear",
    ):  # fmt: skip
        first.press(name)
    first.open("Ground")
    first.press("Change the ground")
    first.open("Play")
    first.press("Restart")
    # A second viewer looks, and may not touch until it takes the controls.
    second = Watched(browser, address, size=(420, 800))
    second.press("Restart")
    second.sees("Another viewer holds the controls")
    second.press("Take control")
    drag_begun = len(inputs(walk_run / "simulate" / "session-1"))
    second.tab.close()
    time.sleep(1.0)
    first.press("Record")
    first.sees("kinemimic simulate --replay")
    found = inputs(walk_run / "simulate" / "session-1")
    kinds = [one["type"] for one in found]
    assert kinds.count("push") == 6
    assert kinds.count("throw") == 4
    assert {"clear", "ground", "restart"} <= set(kinds)
    assert kinds.count("restart") == 1
    assert kinds.index("drag") < kinds.index("release")
    assert len(found) >= drag_begun
    # Nothing is asked of another host.
    assert first.hosts | second.hosts <= {"127.0.0.1"}
    assert first.errors == second.errors == []
    first.tab.close()


def test_a_viewer_that_leaves_in_the_middle_of_a_drag_lets_go(
    browser: Any, address: str, walk_run: Path
) -> None:
    one = Watched(browser, address)
    one.press("Record")
    one.sees("recording into")
    drag(one, walk_run / "simulate" / "session-2", release=False)
    one.tab.close()
    time.sleep(1.0)
    found = [one["type"] for one in inputs(walk_run / "simulate" / "session-2")]
    assert found[-1] == "release"
    again = Watched(browser, address)
    again.press("Record")
    again.tab.reload()
    again.sees("upright")
    again.tab.close()


def test_policy_scenario_and_speed_change_while_it_runs(browser: Any, address: str) -> None:
    one = Watched(browser, address)
    one.open("Ground")
    one.tab.get_by_label("Scenario").first.click()
    one.tab.get_by_role("option", name="thrown-ball").click()
    one.press("Enter the scenario")
    one.open("Play")
    one.tab.get_by_label("Policy").first.click()
    one.tab.get_by_role("option", name="tracker").click()
    one.press("Change policy and motion")
    one.sees("tracker performs")
    one.press("Pause")
    one.sees("paused")
    one.press("One step")
    one.press("Pause")
    one.sees("upright")
    assert one.errors == []
    one.tab.close()
