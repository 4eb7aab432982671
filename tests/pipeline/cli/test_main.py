"""The command line: fast to start, and every way in which a command ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import click
import pytest

from kinemimic.pipeline.catalog.command import COMMANDS as OF_DATASETS
from kinemimic.pipeline.cli import lazy_group
from kinemimic.pipeline.cli.main import COMMANDS, main
from kinemimic.pipeline.errors import KinemimicError

HEAVY = ("numpy", "scipy", "torch", "pandas", "pyarrow", "matplotlib", "rerun", "pybullet", "cv2", "rich")

Failing = Callable[[BaseException], int]


@pytest.fixture
def ending(monkeypatch: pytest.MonkeyPatch) -> Failing:
    """Exit status of `kinemimic view` when that command raises an exception."""

    def status(error: BaseException) -> int:
        @click.command()
        def command() -> None:
            raise error

        monkeypatch.setattr(lazy_group, "load", lambda where: command)
        with pytest.raises(SystemExit) as ended:
            main(["view"])
        assert isinstance(ended.value.code, int)
        return ended.value.code

    return status


def call(*arguments: str) -> int:
    with pytest.raises(SystemExit) as ended:
        main(list(arguments))
    assert isinstance(ended.value.code, int)
    return ended.value.code


def in_a_process(code: str, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", code, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def test_help_loads_nothing_heavy() -> None:
    code = f"""
import sys
from kinemimic.pipeline.cli.main import main
try:
    main(["--help"])
except SystemExit as ended:
    assert ended.code == 0
sys.exit(", ".join(name for name in {HEAVY} if name in sys.modules) or 0)
"""
    process = in_a_process(code)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 0, f"loaded: {err}"
    assert all(name in out for name in COMMANDS)


@pytest.mark.parametrize("name", [*COMMANDS, *(f"datasets {name}" for name in OF_DATASETS)])
def test_every_command_explains_its_options(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(*name.split(), "--help") == 0
    out = capsys.readouterr().out
    if name == "datasets":
        assert all(one in out for one in OF_DATASETS)
        return
    # Commands on captures, shipped policies or several runs have no run folder.
    without = (
        "batch",
        "compare",
        "correct-tracker",
        "evaluate-tracker",
        "formats",
        "gallery",
        "inspect",
        "library",
        "policies",
        "study",
        "train-predictor",
        "train-tracker",
    )
    alone = name.startswith("datasets ") or name in without
    assert "--run" in out or alone
    # What happens in `simulate` is on its page.
    assert "--json" in out or name == "simulate"


def test_an_unknown_command_suggests_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("retraget") == 2
    assert "did you mean 'retarget'?" in capsys.readouterr().err


def test_an_unknown_option_is_a_usage_error(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("convert", "--bogus") == 2
    assert "--bogus" in capsys.readouterr().err


def test_an_error_of_the_input_is_one_line(ending: Failing, capsys: pytest.CaptureFixture[str]) -> None:
    assert ending(KinemimicError("walk.bvh, line 3: expected a number,\n found 'x'")) == 2
    assert capsys.readouterr().err == "kinemimic: walk.bvh, line 3: expected a number, found 'x'\n"


def test_a_full_disk_is_one_line(ending: Failing, capsys: pytest.CaptureFixture[str]) -> None:
    assert ending(OSError(28, "No space left on device", "runs/a/clip.parquet")) == 2
    assert capsys.readouterr().err == "kinemimic: runs/a/clip.parquet: no space left on device\n"


def test_a_run_folder_that_is_a_file_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    blocked = tmp_path / "taken"
    blocked.write_text("")
    for name in ("ingest", "convert", "view"):
        assert call(name, "--run", str(blocked)) == 2
        (line,) = capsys.readouterr().err.strip().splitlines()
        assert line == f"kinemimic: {blocked}: expected a run folder, found a file; choose another --run"


def test_a_long_path_does_not_hide_the_message(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["gait", "--run", "/tmp/" + "a" * 5000])
    err = capsys.readouterr().err
    assert ended.value.code == 2
    assert "(5,005 characters): file name too long" in err
    assert len(err) < 200


def test_a_current_folder_that_was_deleted_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (gone := tmp_path / "gone").mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    with pytest.raises(SystemExit) as ended:
        main(["ingest", "--run", "x"])
    assert ended.value.code == 2
    assert (
        capsys.readouterr().err == "kinemimic: the current folder no longer exists; change to another one\n"
    )


def test_ctrl_c_is_one_line_and_130(ending: Failing, capsys: pytest.CaptureFixture[str]) -> None:
    assert ending(KeyboardInterrupt()) == 130
    assert capsys.readouterr().err.strip() == "kinemimic: interrupted"


def test_a_signal_ends_a_process_with_130() -> None:
    code = """
import click, signal, time
from kinemimic.pipeline.cli import lazy_group
from kinemimic.pipeline.cli.main import main
# A job that a shell put into the background, as a CI may, hands its children a SIGINT that is ignored.
signal.signal(signal.SIGINT, signal.default_int_handler)
@click.command()
def command():
    print("ready", flush=True)
    time.sleep(30)
lazy_group.load = lambda where: command
main(["view"])
"""
    process = in_a_process(code)
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert err.strip() == "kinemimic: interrupted"


@pytest.mark.parametrize("bug", [ZeroDivisionError(), EOFError("worker"), ConnectionResetError("worker")])
def test_a_bug_keeps_its_traceback(bug: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    @click.command()
    def command() -> None:
        raise bug

    monkeypatch.setattr(lazy_group, "load", lambda where: command)
    with pytest.raises(type(bug)):
        main(["view"])


def test_a_broken_pipe_is_quiet() -> None:
    code = """
import click
from kinemimic.pipeline.cli import lazy_group
from kinemimic.pipeline.cli.main import main
@click.command()
def command():
    for _ in range(100000):
        click.echo("a line of output")
lazy_group.load = lambda where: command
main(["view"])
"""
    reading, writing = os.pipe()
    process = subprocess.Popen(
        [sys.executable, "-c", code], stdout=writing, stderr=subprocess.PIPE, text=True
    )
    os.close(writing)
    os.close(reading)
    _, err = process.communicate(timeout=30)
    assert err == ""
    assert process.returncode == 1
