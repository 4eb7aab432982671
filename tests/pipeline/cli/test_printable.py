"""Text of files reaches a terminal and a page without control characters, and prints in any encoding."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from jinja2 import Environment
from rich.console import Console
from rich.text import Text

from kinemimic.pipeline.catalog.command import COMMANDS as OF_DATASETS
from kinemimic.pipeline.cli.html import render
from kinemimic.pipeline.cli.main import COMMANDS, main
from kinemimic.pipeline.cli.printable import echo, printable
from kinemimic.pipeline.cli.terminal import grid, show

# Clears the screen, renames the window, reverses the text, and an unpaired half of a character.
HOSTILE = "a\x1b[2Jb\x1b]0;owned\x07c\x9b1md\u202ee\udc80"
SHOWN = "a\\u001b[2Jb\\u001b]0;owned\\u0007c\\u009b1md\\u202ee\\udc80"
PROGRAM = "from kinemimic.pipeline.cli.main import main; main()"


def test_only_control_and_format_characters_are_replaced() -> None:
    assert printable(HOSTILE) == SHOWN
    plain = "knee\tleft:\n R²\u00a0≥ 0.9 – Höhe 身高 \u2009½ \U0001f6b6"
    assert printable(plain) == plain
    assert printable("a\rb\x00\x7f\u2028\ufeff\U000e0001") == (
        "a\\u000db\\u0000\\u007f\\u2028\\ufeff\\U000e0001"
    )
    # In JSON, the number stands for the same character.
    assert json.loads(f'"{printable("x" + chr(0x9B))}"') == "x\x9b"


def test_what_is_printed_is_printable(capsys: pytest.CaptureFixture[str]) -> None:
    table = grid("joint", "frames")
    table.add_row(HOSTILE, Text(HOSTILE, style="bold"))
    show(HOSTILE, table, wrap=False)
    echo(HOSTILE)
    echo(HOSTILE, err=True)
    out, err = capsys.readouterr()
    assert out.count(SHOWN) >= 3  # a Text in a table may be cut
    assert err == SHOWN + "\n"
    assert not set(out) & set("\x1b\x07\x9b\u202e")


def test_on_a_terminal_only_our_own_style_remains(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    stream = io.StringIO()
    monkeypatch.setattr(sys, "stdout", stream)
    show(Text(HOSTILE, style="bold"))
    assert Console(file=stream).is_terminal
    assert stream.getvalue().startswith("\x1b[1m" + SHOWN[:20])
    assert stream.getvalue().count("\x1b") == 2


def test_errors_are_printable(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in (["retarget", "--run", "/none", f"--{HOSTILE}"], ["ingest", f"/none/{HOSTILE}.bvh"]):
        with pytest.raises(SystemExit):
            main(arguments)
        err = capsys.readouterr().err
        assert "1b[2J" in err
        assert not set(err) & set("\x1b\x07\x9b\u202e\udc80")


def test_a_page_is_printable(tmp_path: Path) -> None:
    text = "<b>{{ name }}</b> {{ name ~ '!' }} {{ '%s' | format(name) }}"
    (tmp_path / "page.html").write_text(text)
    page = render(tmp_path / "page.html", name=f"<i>{HOSTILE}")
    assert f"<b>&lt;i&gt;{SHOWN}</b>" in page
    assert not set(page) & set("\x1b\x07\x9b\u202e\udc80")
    assert Environment().from_string(page)


def in_encoding(encoding: str, folder: Path, *arguments: str) -> subprocess.CompletedProcess[bytes]:
    environment = os.environ | {"PYTHONIOENCODING": encoding, "XDG_CACHE_HOME": str(folder)}
    if encoding == "C":
        del environment["PYTHONIOENCODING"]
        environment |= {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}
    command = [sys.executable, "-c", PROGRAM, *arguments]
    return subprocess.run(command, env=environment, capture_output=True, cwd=folder, check=False)


NAMES = [*(name for name in COMMANDS if name != "datasets"), *(f"datasets {name}" for name in OF_DATASETS)]


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "C"])
def test_whatever_is_printed_can_be_encoded(tmp_path: Path, encoding: str) -> None:
    for arguments in (
        ("formats",),
        ("datasets", "list"),
        ("policies",),
        ("disturb",),
        ("study", "--help"),
    ):
        done = in_encoding(encoding, tmp_path, *arguments)
        assert done.returncode == 0, done.stderr
        assert b"Traceback" not in done.stderr
        assert len(done.stdout) > 200
        if encoding != "latin-1" and "--help" not in arguments:  # click prints its help in UTF-8
            done.stdout.decode("ascii")


def test_signs_have_a_form_in_ascii(tmp_path: Path) -> None:
    code = (
        "from kinemimic.pipeline.cli.printable import *; replace_what_cannot_be_encoded();"
        "echo('R² ≥ 0.9 – 3° … 身 ' + chr(0x1f6b6))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"PYTHONIOENCODING": "ascii"},
        capture_output=True,
        check=True,
    )
    assert done.stdout == b"R^2 >= 0.9 - 3 deg ... \\u8eab \\U0001f6b6\n"


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_every_command_explains_itself_in_ascii(tmp_path: Path, name: str) -> None:
    done = in_encoding("ascii", tmp_path, *name.split(), "--help")
    assert (done.returncode, done.stderr) == (0, b"")
