"""The picture of the packages is that of the code, and no packages import each other in a ring."""

from __future__ import annotations

import importlib
import re
import subprocess
import sys

import pytest
from printed.blocks import ROOT

FOLDERS = ("pipeline", "retarget", "train", "evaluate")
SCRIPT = ROOT / "docs" / "draw_architecture.py"


def run(code: str) -> str:
    """What Python prints with the drawing script imported; grimp keeps its graph out of this process."""
    program = (
        f"import sys; sys.path.insert(0, {str(SCRIPT.parent)!r})\nfrom draw_architecture import *\n{code}"
    )
    return subprocess.run(
        [sys.executable, "-c", program], check=True, capture_output=True, text=True
    ).stdout.strip()


def test_the_picture_is_up_to_date() -> None:
    assert run("print(svg() == OUTPUT.read_text())") == "True", "run `make architecture`"


def test_no_rooms_import_each_other_in_a_ring() -> None:
    assert run("print(cycle(packages()[1]))") == "[]"


def test_a_ring_is_found() -> None:
    assert run("print(cycle({'a': {'b'}, 'b': {'c'}, 'c': {'a'}}))") == "['a', 'b', 'c', 'a']"


def test_an_import_that_follows_from_others_is_left_out() -> None:
    assert run("print(reduced({'a': {'b', 'c'}, 'b': {'c'}})['a'])") == "{'b'}"


def named_functions() -> list[tuple[str, str]]:
    """Files and functions that the page names as `file`: `function`."""
    page = (ROOT / "docs" / "architecture.md").read_text()
    return re.findall(r"`([a-z0-9_/]+\.py)`: `([\w.]+)`", page)


@pytest.mark.parametrize(("file", "name"), named_functions())
def test_a_named_function_exists(file: str, name: str) -> None:
    found: object = importlib.import_module("kinemimic." + file.removesuffix(".py").replace("/", "."))
    for part in name.split("."):
        found = getattr(found, part)
    assert callable(found)


def test_every_room_is_on_the_page() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text()
    packages = {path.parent.name for folder in FOLDERS for path in (ROOT / folder).glob("*/__init__.py")}
    assert {package for package in packages if f"`{package}`" not in page} == set()
