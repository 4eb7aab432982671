"""Bars on a terminal, lines in a log, calls in Python; all of them say what, how far and the time left."""

from __future__ import annotations

import io
import re
import threading
from collections.abc import Callable
from types import SimpleNamespace

import click
import pytest

from kinemimic.pipeline.cli import heartbeat as beats
from kinemimic.pipeline.cli.main import main
from kinemimic.pipeline.cli.progress import Bars, activity, bars, progress, reported_to
from kinemimic.pipeline.cli.progress_state import PERCENT, ProgressState, minutes


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


class Pulse:
    """The clock of the heartbeat and of all bars, which stands between beats; the event that it waits on."""

    def __init__(self) -> None:
        self.now, self.waits, self._running = 100.0, list[float](), False

    def begun(self) -> Pulse:
        """In place of `threading.Event`."""
        self._due, self._waiting = threading.Semaphore(0), threading.Semaphore(0)
        self._running = True
        return self

    def set(self) -> None:
        self._running = False
        self._due.release()

    def wait(self, seconds: float) -> bool:
        self.waits.append(seconds)
        self._waiting.release()
        self._due.acquire()
        return not self._running

    def beat(self) -> None:
        """Let the seconds pass that the heartbeat waits, if there is one, and return when it waits again."""
        if not self._running:
            return
        assert self._waiting.acquire(timeout=60.0)
        self.now += self.waits[-1]
        self._due.release()
        assert self._waiting.acquire(timeout=60.0), "the heartbeat has ended"
        self._waiting.release()


@pytest.fixture
def pulse(monkeypatch: pytest.MonkeyPatch) -> Pulse:
    one = Pulse()
    monkeypatch.setattr(beats, "threading", SimpleNamespace(Event=one.begun, Thread=threading.Thread))
    monkeypatch.setattr(beats, "time", SimpleNamespace(monotonic=lambda: one.now))
    monkeypatch.setattr(Bars.__init__, "__defaults__", (lambda: one.now,))
    return one


@click.command()
@click.option("--json", "as_json", is_flag=True)
@click.pass_obj
def work(then: Callable[[], None], as_json: bool) -> None:
    with progress("work", 4) as bar:
        for _ in range(4):
            bar.advance(1, reward=0.5)
        then()


def written(
    arguments: list[str],
    stderr: io.StringIO,
    monkeypatch: pytest.MonkeyPatch,
    then: Callable[[], None] = lambda: None,
) -> str:
    """What `work` writes to stderr; then: called before its bar ends."""
    monkeypatch.setattr("sys.stderr", stderr)
    work.main(arguments, standalone_mode=False, obj=then)
    return stderr.getvalue()


def test_a_terminal_shows_count_and_notes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "120")
    text = written([], Terminal(), monkeypatch)
    assert "4 of 4" in text
    assert "reward 0.5" in text


@pytest.mark.parametrize("columns", [40, 60, 80, 132])
def test_the_time_left_fits_into_every_width(
    columns: int, monkeypatch: pytest.MonkeyPatch, pulse: Pulse
) -> None:
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setattr("sys.stderr", terminal := Terminal())
    with bars() as several:
        bar = several.add("walk@several-obstacles sb3-ppo seed 3", 1_000_000, done=10, unit="samples")
        pulse.now += 0.5
        bar.advance(1000, reward=0.1234567, steps=203.4, upright="600/600")
        bar.ends_within(4000.0)
    rows = [row for row in re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", terminal.getvalue()).splitlines() if row]
    assert max(map(len, rows)) <= columns
    # Bars are drawn a last time when they end.
    last = [row for row in rows if row.startswith("walk@several")][-1]
    assert last.rstrip().endswith(" 8:19 left")  # 998,990 at 2000 per second


def test_silent_under_json(monkeypatch: pytest.MonkeyPatch, pulse: Pulse) -> None:
    monkeypatch.setenv("TERM", "xterm")
    assert written(["--json"], Terminal(), monkeypatch, pulse.beat) == ""
    assert written(["--json"], io.StringIO(), monkeypatch, pulse.beat) == ""


def test_without_a_terminal_there_is_a_line_at_every_beat(
    monkeypatch: pytest.MonkeyPatch, pulse: Pulse
) -> None:
    def twice() -> None:
        pulse.beat()
        pulse.beat()

    assert written([], io.StringIO(), monkeypatch, twice).splitlines() == [
        "work: 100 %, 4 of 4, took 0:15; reward 0.5",
        "work: 100 %, 4 of 4, took 0:30; reward 0.5",
    ]
    assert pulse.waits == [15.0] * 3


def test_no_line_before_its_time(monkeypatch: pytest.MonkeyPatch, pulse: Pulse) -> None:
    assert written([], io.StringIO(), monkeypatch) == ""


def test_the_innermost_task_is_in_the_log(capsys: pytest.CaptureFixture[str], pulse: Pulse) -> None:
    def line() -> str:
        capsys.readouterr()
        pulse.beat()
        return capsys.readouterr().err

    with activity("ingest"):
        assert line() == "ingest: running for 15 s\n"
        with bars() as several:
            assert line() == ""  # nothing to say yet
            several.add("all", 4).advance(1)
            several.add("part", 2)
            assert line() == "all: 25 %, 1 of 4, 0:45 left\n"
        assert line() == "ingest: running for 60 s\n"
    assert line() == ""


def test_one_long_call_does_not_silence_the_log(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(beats, "INTERVAL", 0.02)
    lines = list[str]()
    with progress("sort", 2):
        for _ in range(1000):
            sum(range(3_000_000))  # one call that holds the interpreter's lock
            lines += capsys.readouterr().err.splitlines()
            if len(lines) >= 2:
                break
    assert len(lines) >= 2


def test_commands_have_a_heartbeat(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, pulse: Pulse
) -> None:
    class Slow:
        @staticmethod
        def main(*_: object, **__: object) -> None:
            pulse.beat()

    monkeypatch.setattr("kinemimic.pipeline.cli.main.cli", Slow)
    for arguments, said in (
        (["retarget", "--run", "x"], "retarget: running for 15 s\n"),
        (["retarget", "--json"], ""),
    ):
        with pytest.raises(SystemExit):
            main(arguments)
        assert capsys.readouterr().err == said


def test_a_callback_gets_every_change_and_nothing_is_drawn(
    capsys: pytest.CaptureFixture[str], pulse: Pulse
) -> None:
    states: list[ProgressState] = []
    with (
        reported_to(states.append),
        activity("outer"),
        progress("train", 100, done=40, unit="samples") as bar,
    ):
        bar.advance(10, reward=0.5)
        pulse.beat()
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
