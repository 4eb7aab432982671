"""Bars on a terminal, lines in a log, calls in Python; all of them say what, how far and the time left."""

from __future__ import annotations

import io
import re
import time
from collections.abc import Callable

import click
import pytest

from kinemimic.pipeline.cli import heartbeat as beats
from kinemimic.pipeline.cli.main import main
from kinemimic.pipeline.cli.progress import Bars, bars, progress, reported_to, stage
from kinemimic.pipeline.cli.progress_state import PERCENT, ProgressState, minutes


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@click.command()
@click.option("--json", "as_json", is_flag=True)
def work(as_json: bool) -> None:
    with progress("work", 4) as bar:
        for _ in range(4):
            bar.advance(1, reward=0.5)
        time.sleep(0.1)


def written(arguments: list[str], stderr: io.StringIO, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setattr("sys.stderr", stderr)
    work.main(arguments, standalone_mode=False)
    return stderr.getvalue()


@pytest.fixture
def often(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(beats, "INTERVAL", 0.02)


def test_a_terminal_shows_count_and_notes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "120")
    text = written([], Terminal(), monkeypatch)
    assert "4 of 4" in text
    assert "reward 0.5" in text


@pytest.mark.parametrize("columns", [40, 60, 80, 132])
def test_the_time_left_fits_into_every_width(columns: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setattr("sys.stderr", terminal := Terminal())
    with bars() as several:
        bar = several.add("walk@several-obstacles sb3-ppo seed 3", 1_000_000, done=10, unit="samples")
        bar.advance(1000, reward=0.1234567, steps=203.4, upright="600/600")
        bar.ends_within(4000.0)
        time.sleep(0.5)
    rows = [row for row in re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", terminal.getvalue()).splitlines() if row]
    assert max(map(len, rows)) <= columns
    first = [row for row in rows if row.startswith("walk@several")]
    assert first
    assert all(re.search(r"\d:\d\d left$", row.rstrip()) for row in first[1:])


def test_silent_under_json(monkeypatch: pytest.MonkeyPatch, often: None) -> None:
    monkeypatch.setenv("TERM", "xterm")
    assert written(["--json"], Terminal(), monkeypatch) == ""
    assert written(["--json"], io.StringIO(), monkeypatch) == ""


def test_without_a_terminal_there_are_lines(monkeypatch: pytest.MonkeyPatch, often: None) -> None:
    lines = written([], io.StringIO(), monkeypatch).splitlines()
    assert len(lines) >= 2
    assert lines[-1] == "work: 100 %, 4 of 4, took 0:00; reward 0.5"


def test_no_line_before_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    assert written([], io.StringIO(), monkeypatch) == ""


def test_the_innermost_task_is_in_the_log(capsys: pytest.CaptureFixture[str], often: None) -> None:
    def lines() -> set[str]:
        capsys.readouterr()
        time.sleep(0.15)
        return {re.sub(r"\d+ s", "N s", line) for line in capsys.readouterr().err.splitlines()[1:]}

    with stage("ingest"):
        assert lines() == {"ingest: running for N s"}
        with bars() as several:
            assert lines() == set()  # nothing to say yet
            several.add("all", 4).advance(1)
            several.add("part", 2)
            assert {line.partition(":")[0] for line in lines()} == {"all"}
        assert lines() == {"ingest: running for N s"}
    assert lines() == set()


def test_one_long_call_does_not_silence_the_log(capsys: pytest.CaptureFixture[str], often: None) -> None:
    with progress("sort", 2):
        for _ in range(10):
            sum(range(3_000_000))  # one call that holds the interpreter's lock
    assert len(capsys.readouterr().err.splitlines()) >= 2


def test_commands_have_a_heartbeat(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, often: None
) -> None:
    class Slow:
        @staticmethod
        def main(*_: object, **__: object) -> None:
            time.sleep(0.1)

    monkeypatch.setattr("kinemimic.pipeline.cli.main.cli", Slow)
    for arguments, said in ((["retarget", "--run", "x"], True), (["retarget", "--json"], False)):
        with pytest.raises(SystemExit):
            main(arguments)
        assert ("retarget: running for 0 s" in capsys.readouterr().err) is said


def test_a_callback_gets_every_change_and_nothing_is_drawn(
    capsys: pytest.CaptureFixture[str], often: None
) -> None:
    states: list[ProgressState] = []
    with reported_to(states.append), stage("outer"), progress("train", 100, done=40, unit="samples") as bar:
        bar.advance(10, reward=0.5)
        time.sleep(0.05)
        bar.advance(50)
    assert [(state.what, state.done, state.total) for state in states] == [
        ("train", 50, 100),
        ("train", 100, 100),
    ]
    assert states[0].notes == states[1].notes == {"reward": 0.5}
    assert states[0].share == 0.5
    assert capsys.readouterr().err == ""


def test_what_a_callback_raises_ends_the_task() -> None:
    def stop(state: ProgressState) -> None:
        raise StopIteration(state.what)

    with pytest.raises(StopIteration), reported_to(stop), progress("train", 2) as bar:
        bar.advance()


def test_no_callback_within_a_callback_leaves_that_one_in_place() -> None:
    seen = list[ProgressState]()
    with reported_to(seen.append), reported_to(None), progress("train", 2) as bar:
        bar.advance()
    assert [(state.what, state.done) for state in seen] == [("train", 1)]


@pytest.fixture
def clocked() -> tuple[Bars, Callable[[float], None]]:
    now = [100.0]

    def later(seconds: float) -> None:
        now[0] += seconds

    return Bars(None, clock=lambda: now[0]), later


def test_the_time_left(clocked: tuple[Bars, Callable[[float], None]]) -> None:
    several, later = clocked
    # 40 of 100 were done before: they say nothing about the speed.
    bar = several.add("train", 100, done=40, unit="samples")
    assert bar.state.left is None
    later(20.0)
    bar.advance(10)
    assert bar.state.left == pytest.approx(100.0)  # 50 more at 0.5 per second
    assert bar.state.per_second == pytest.approx(0.5)
    assert str(bar.state) == "train: 50 %, 50 of 100 samples, 1:40 left"
    bar.ends_within(30.0)
    later(10.0)
    assert bar.state.left == pytest.approx(20.0)
    bar.advance(50)
    assert str(bar.state) == "train: 100 %, 100 of 100 samples, took 0:30"


def test_words() -> None:
    assert str(ProgressState("study", 2.5, 8, PERCENT, left=3725.0)) == "study: 31 %, 1:02:05 left"
    assert str(ProgressState("batch", 0, 3, "captures", notes={"now": "a.bvh"})) == (
        "batch: 0 %, 0 of 3 captures; now a.bvh"
    )
    assert ProgressState("nothing", 0, 0).share == 1.0
    assert [minutes(s) for s in (0.4, 59.6, 61, 3600)] == ["0:00", "1:00", "1:01", "1:00:00"]
