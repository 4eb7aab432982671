"""The page in a real browser: drags, buttons, two viewers, reloads; no request leaves this machine."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from peers.browser import CHROMIUM, Watched, chromium, served

from kinemimic.evaluate.simulate.session.recording import Replay
from kinemimic.retarget.humanoid.body import BODY_INDEX
from kinemimic.train.scenario.scenario_file import find_scenario

pytest.importorskip("playwright.sync_api")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="needs the browser chromium"),
]
# The buttons of every tab, and the input that a recording has of each; None: it is no input.
TABS: dict[str, dict[str, str | None]] = {
    "Push": {
        "Forward": "push",
        "Backward": "push",
        "Left": "push",
        "Right": "push",
        "100 N on a thigh": "push",
        "30 N·m on an arm": "push",
        "Throw a ball at the chest": "throw",
        "Throw a ball from the side": "throw",
        "Box of knee height ahead": "throw",
        "Post of hip height ahead": "throw",
        "Remove obstacles and pushes": "clear",
    },
    "Ground": {"Apply": "ground", "Start the scenario": "enter"},
    "Curves": {},
    "Play": {
        "Pause": None,
        "Step": None,
        "Restart": "restart",
        "Change policy and motion": None,
        "Stop recording": None,
    },
}
SHOWN = {"Pause": "paused", "Stop recording": "kinemimic evaluate"}
# By then, another policy has ended the recording.
RENAMED = {"Stop recording": "Record"}
ABOVE = "Take control"


@pytest.fixture
def address(walk_run: Path) -> Iterator[str]:
    """A page of its own for each test, which sees nothing of what another one does."""
    with served("simulate", "--run", str(walk_run), "--port", "18091") as found:
        # viser draws half the pixels each way: the processor draws them.
        yield f"{found}&fixedDpr=0.5"


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as one:
        yield one


@pytest.fixture
def look(browser: Any, address: str) -> Iterator[Callable[..., Watched]]:
    """Opens the page for one more viewer; all leave at the end."""
    opened: list[Watched] = []

    def one(**options: Any) -> Watched:
        opened.append(Watched(browser, address, **options))
        return opened[-1]

    yield one
    for watched in opened:
        watched.tab.context.close()


def red(watched: Watched) -> int:
    """Number of pixels of the scene, left of the panel, as red as an arrow of a force: nothing else there has
    more blue than green."""
    image = watched.image()[:, :660]
    return int(((image[..., 0] - image[..., 1] > 60) & (image[..., 2] >= image[..., 1])).sum())


def recorded(run: Path) -> Path:
    """The newest recording."""
    return max((run / "simulate").glob("session-*"), key=lambda folder: int(folder.name.split("-")[1]))


def inputs(run: Path) -> list[dict[str, Any]]:
    """Of the newest recording; the last line may be half written."""
    lines = (recorded(run) / "session.jsonl").read_text().splitlines(keepends=True)
    return [found["input"] for one in lines if one.endswith("\n") and "input" in (found := json.loads(one))]


def kinds(run: Path) -> list[str]:
    return [one["type"] for one in inputs(run)]


def awaits(run: Path, *types: str) -> None:
    """Return when the newest recording ends with these inputs; fail if it does not within a minute."""
    until = time.monotonic() + 60.0
    while kinds(run)[-len(types) :] != [*types]:
        assert time.monotonic() < until, (types, kinds(run))
        time.sleep(0.2)


def record(watched: Watched) -> None:
    watched.press("Record")
    watched.sees("● recording into")


def drag(watched: Watched, run: Path) -> None:
    """Drag what stands in the middle of the scene, once that is drawn, and hold it there."""
    mouse = watched.tab.mouse
    x, y = 340, 325
    for _ in range(20):
        mouse.move(x, y)
        mouse.down()
        for k in range(15):
            mouse.move(x + 4 * k, y - k)
            time.sleep(0.06)
        if "drag" in kinds(run):
            return
        mouse.up()
        time.sleep(1.5)
    raise AssertionError("no drag arrived")


def test_a_drag_shows_its_force_and_moves_the_humanoid(look: Callable[..., Watched], walk_run: Path) -> None:
    page = look()
    record(page)
    before = red(page)
    drag(page, walk_run)
    # The arrow is short whenever the body passes the pointer.
    assert any(red(page) > before + 30 for _ in range(30))
    page.tab.mouse.up()
    awaits(walk_run, "release")
    page.press("Stop recording")
    page.sees("kinemimic evaluate")
    assert page.hosts <= {"127.0.0.1"}
    assert page.errors == []
    body = BODY_INDEX[next(one["body"] for one in inputs(walk_run) if one["type"] == "drag")]
    frames = list(Replay(recorded(walk_run), named=find_scenario))
    forces = [np.linalg.norm(frame.drag[2]) for frame in frames if frame.drag is not None]
    assert max(forces) > 20.0
    away = np.array([frame.bodies.positions[body] - frame.target.positions[body] for frame in frames])
    begun = next(k for k, frame in enumerate(frames) if frame.drag is not None)
    assert np.linalg.norm(away[begun:], axis=-1).max() > np.linalg.norm(away[begun]) + 0.05


def test_every_button_of_the_page_does_what_it_says(look: Callable[..., Watched], walk_run: Path) -> None:
    page = look()
    record(page)
    expected: list[str] = []
    for tab, buttons in TABS.items():
        page.open(tab)
        if buttons:
            page.tab.get_by_role("button", name=next(iter(buttons)), exact=True).wait_for()
        # No button is here that the test does not press.
        assert page.buttons() == [ABOVE, *buttons]
        for name, kind in buttons.items():
            page.press(RENAMED.get(name, name))
            if kind is not None:
                expected.append(kind)
                awaits(walk_run, *expected)
            elif name in SHOWN:
                page.sees(SHOWN[name])
    page.press(ABOVE)
    assert page.hosts <= {"127.0.0.1"}
    assert page.errors == []


def test_one_of_two_viewers_holds_the_controls(look: Callable[..., Watched], walk_run: Path) -> None:
    first = look()
    record(first)
    second = look(size=(420, 800))
    second.press("Restart")
    second.sees("Another viewer holds the controls")
    assert kinds(walk_run) == []
    second.press(ABOVE)
    second.press("Restart")
    # Who takes the controls lets go of what the other one drags.
    awaits(walk_run, "release", "restart")
    first.press("Restart")
    first.sees("Another viewer holds the controls")
    assert kinds(walk_run) == ["release", "restart"]
    # They go back when the second viewer leaves.
    second.tab.close()
    awaits(walk_run, "release", "restart", "release")
    first.press("Restart")
    awaits(walk_run, "release", "restart", "release", "restart")
    first.press("Stop recording")
    first.sees("kinemimic evaluate")
    assert first.hosts | second.hosts <= {"127.0.0.1"}
    assert first.errors == second.errors == []


def test_a_viewer_that_leaves_in_the_middle_of_a_drag_lets_go(
    look: Callable[..., Watched], walk_run: Path
) -> None:
    one = look()
    record(one)
    drag(one, walk_run)
    one.tab.close()
    awaits(walk_run, "release")  # one of the drag that ends, or also one of the viewer that left
    again = look()
    again.press("Stop recording")
    again.tab.reload()
    again.sees("upright")
    assert one.errors == again.errors == []


def test_it_falls_and_stands_up_again(look: Callable[..., Watched], walk_run: Path) -> None:
    page = look()
    record(page)
    page.sees("upright, 0 falls")
    page.open("Push")
    page.sets("Force, N", 500)
    page.tab.get_by_label("Increase gradually").uncheck()
    page.press("Left")
    page.sees("fallen, 1 fall,")
    page.sees("upright, 1 fall,")
    assert inputs(walk_run)[0]["force"] == pytest.approx([0.0, 500.0, 0.0])
    page.press("Remove obstacles and pushes")
    page.open("Play")
    page.press("Stop recording")
    assert page.errors == []


def test_policy_scenario_and_speed_change_while_it_runs(look: Callable[..., Watched]) -> None:
    one = look()
    one.open("Ground")
    one.chooses("Scenario", "thrown-ball")
    one.press("Start the scenario")
    one.open("Play")
    one.sets("Playback speed", 0.5)
    one.chooses("Policy", "tracker")
    one.press("Change policy and motion")
    one.sees("tracker performs")
    one.press("Pause")
    one.sees("paused")
    one.press("Step")
    one.press("Resume")
    one.sees("upright")
    assert one.errors == []


def test_a_push_acts_on_twenty_humanoids(browser: Any, tmp_path: Path) -> None:
    run = tmp_path / "walk"
    arguments = ("--policy", "walk", "--run", str(run), "--humanoids", "20", "--port", "18092")
    with served("simulate", *arguments) as address:
        page = Watched(browser, f"{address}&fixedDpr=0.5")
        page.sees("20 of 20 humanoids have not fallen since the last push")
        page.open("Push")
        page.sets("Force, N", 500)
        page.tab.get_by_label("Increase gradually").uncheck()
        page.press("Left")
        page.sees("0 of 20 humanoids have not fallen since the last push")
        assert page.hosts <= {"127.0.0.1"}
        assert page.errors == []
        page.tab.context.close()
