"""A tab of Debian's chromium on the page of `simulate` and `stream`, which watches what the page does."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

CHROMIUM = shutil.which("chromium")
_SOFTWARE = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]
PATIENCE = 20_000  # ms: without a GPU the first picture takes seconds


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
        self.tab = browser.new_context(viewport={"width": size[0], "height": size[1]}).new_page()
        self.asked: list[str] = []
        self.errors: list[str] = []
        self.tab.on("request", lambda request: self.asked.append(request.url))
        self.tab.on("websocket", lambda socket: self.asked.append(socket.url))
        self.tab.on("pageerror", lambda error: self.errors.append(str(error)))
        self.tab.on("console", lambda said: said.type == "error" and self.errors.append(said.text))
        self.tab.goto(address)
        self.tab.get_by_text("of steps on time").wait_for(timeout=PATIENCE)

    def press(self, name: str) -> None:
        self.tab.get_by_role("button", name=name, exact=True).click()

    def open(self, name: str) -> None:
        self.tab.get_by_role("tab", name=name).click()

    def sees(self, text: str) -> None:
        self.tab.get_by_text(text).first.wait_for(timeout=PATIENCE)

    @property
    def hosts(self) -> set[str]:
        """The hosts that anything was asked of."""
        return {re.sub(r"^(blob:)?\w+://([^/:]+).*", r"\2", url) for url in self.asked}
