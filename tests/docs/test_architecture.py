"""The picture of the rooms is that of the code, and no rooms import each other in a ring."""

from __future__ import annotations

import subprocess
import sys

from printed.blocks import ROOT

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
    assert run("print(cycle(rooms()[1]))") == "[]"


def test_a_ring_is_found() -> None:
    assert run("print(cycle({'a': {'b'}, 'b': {'c'}, 'c': {'a'}}))") == "['a', 'b', 'c', 'a']"


def test_an_import_that_follows_from_others_is_left_out() -> None:
    assert run("print(reduced({'a': {'b', 'c'}, 'b': {'c'}})['a'])") == "{'b'}"
