"""A tab of Debian's chromium on the page of `simulate` and `stream`, which watches what the page does."""

from __future__ import annotations

import io
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

CHROMIUM = shutil.which("chromium")
_SOFTWARE = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]
PATIENCE = 90_000  # ms: without a GPU, and beside other work, the first picture takes a while
# Of viser's own: react-three-fiber listens to presses of the pointer passively, so that viser, which means to
# prevent what a browser does with a press, cannot. It selects no text, because the scene has none; the drag
# itself begins all the same.
_HARMLESS = "Unable to preventDefault inside passive event listener invocation."


@contextmanager
def chromium() -> Iterator[Any]:
    """A browser without a window, drawn by the processor."""
    from playwright import sync_api  # noqa: PLC0415 (only some environments have it)

    with sync_api.sync_playwright() as playwright:
        one = playwright.chromium.launch(executable_path=CHROMIUM, args=_SOFTWARE)
        yield one
        one.close()


@contextmanager
def served(*arguments: str) -> Iterator[str]:
    """The address that a command of kinemimic prints, while it runs."""
    program = [sys.executable, "-m", "kinemimic", *arguments]
    process = subprocess.Popen(program, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        found = re.search(r"http\S+", process.stdout.readline())
        assert found is not None
        yield found[0]
    finally:
        process.terminate()
        process.wait(timeout=20)


class Watched:
    """A tab that keeps the addresses it asks for and the errors of its console."""

    def __init__(self, browser: Any, address: str, size: tuple[int, int] = (1000, 700)) -> None:
        context = browser.new_context(viewport={"width": size[0], "height": size[1]})
        context.set_default_timeout(PATIENCE)
        self.tab = context.new_page()
        self.asked: list[str] = []
        self.errors: list[str] = []
        self.tab.on("request", lambda request: self.asked.append(request.url))
        self.tab.on("websocket", lambda socket: self.asked.append(socket.url))
        self.tab.on("pageerror", lambda error: self.errors.append(str(error)))
        self.tab.on("console", self._said)
        self.tab.goto(address)
        self.sees("of steps on time")

    def _said(self, message: Any) -> None:
        if message.type == "error" and message.text != _HARMLESS:
            self.errors.append(message.text)

    def press(self, name: str) -> None:
        self.tab.get_by_role("button", name=name, exact=True).click()

    def open(self, name: str) -> None:
        self.tab.get_by_role("tab", name=name).click()

    def sees(self, text: str) -> None:
        self.tab.get_by_text(text).first.wait_for()

    def sets(self, label: str, number: float) -> None:
        """Type a number beside a slider."""
        field = self.tab.get_by_text(label, exact=True).locator("xpath=following::input[@type='text'][1]")
        field.fill(str(number))
        field.press("Enter")

    def chooses(self, label: str, name: str) -> None:
        """An option of a list."""
        self.tab.get_by_label(label, exact=True).first.click()
        self.tab.get_by_role("option", name=name, exact=True).click()

    def buttons(self) -> list[str]:
        """The named buttons of the open tab, beside it those above the tabs."""
        return [name for one in self.tab.get_by_role("button").all() if (name := one.inner_text().strip())]

    def image(self) -> NDArray[np.int64]:
        """The page as it looks, (H, W, 3)."""
        return np.asarray(Image.open(io.BytesIO(self.tab.screenshot())).convert("RGB"), dtype=np.int64)

    def pixels(self, color: tuple[int, int, int]) -> int:
        """Number of pixels of the page near a colour."""
        return int((np.abs(self.image() - color).max(axis=-1) <= 12).sum())

    @property
    def hosts(self) -> set[str]:
        """The hosts that anything was asked of."""
        return {re.sub(r"^(blob:)?\w+://([^/:]+).*", r"\2", url) for url in self.asked}
