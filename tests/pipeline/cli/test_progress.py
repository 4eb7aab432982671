"""The progress bar is drawn only on a terminal."""

from __future__ import annotations

import io

import click
import pytest
from click.testing import CliRunner

from kinemimic.pipeline.cli.progress import progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@click.command()
@click.option("--json", "as_json", is_flag=True)
def work(as_json: bool) -> None:
    with progress("work", 4) as bar:
        for _ in range(4):
            bar.advance(1, reward=0.5)


def written(arguments: list[str], stderr: io.StringIO, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setattr("sys.stderr", stderr)
    work.main(arguments, standalone_mode=False)
    return stderr.getvalue()


def test_a_terminal_shows_count_and_fields(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "120")
    text = written([], Terminal(), monkeypatch)
    assert "4/4" in text
    assert "reward 0.5" in text


def test_silent_under_json(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    assert written(["--json"], Terminal(), monkeypatch) == ""


def test_silent_when_stderr_is_no_terminal() -> None:
    result = CliRunner().invoke(work, [])
    assert result.exit_code == 0
    assert result.output == ""
