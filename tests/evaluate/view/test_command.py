"""kinemimic view: the recording, pictures and videos of a run; what is missing or refused is one line."""

from __future__ import annotations

import json
import resource
import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from peers.viewed import FRAMES, fill, loaded

from kinemimic.evaluate.film.film import render_frames, scene_of
from kinemimic.evaluate.view import command as module
from kinemimic.evaluate.view.command import command, how_to_open, view
from kinemimic.pipeline.cli.main import main
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.rollout.trajectory import Trajectory


@pytest.mark.parametrize("missing", ["motion.json", "trajectory.npz"])
def test_missing_files_are_named_and_nothing_is_written(
    tmp_path: Path, walk: Motion, performance: Callable[..., Trajectory], missing: str
) -> None:
    (fill(tmp_path, walk, performance(1, 5)) / missing).unlink()
    with pytest.raises(KinemimicError, match=missing):
        view(tmp_path)
    assert len(list(tmp_path.iterdir())) == 1


def test_command_prints_the_path_and_how_to_open_it(run: Path) -> None:
    text = CliRunner().invoke(command, ["--run", str(run)])
    assert text.exit_code == 0
    assert text.output.strip() == f"{run}/view.rrd ({how_to_open(run / 'view.rrd')})"
    text = CliRunner().invoke(command, ["--run", str(run), "--json"])
    assert json.loads(text.output) == {"recording": f"{run}/view.rrd", "screenshot": None, "video": None}


def test_a_full_disk_is_one_clear_line_and_leaves_the_view_of_before(
    run: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    before = (run / "view.rrd").read_bytes()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(before) // 2, limits[1]))
    try:
        with pytest.raises(SystemExit) as left:
            main(["view", "--run", str(run)])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert left.value.code == 2
    text = capfd.readouterr()
    assert text.err == f"kinemimic: {run / 'view.rrd'}: file too large\n" and not text.out
    assert (run / "view.rrd").read_bytes() == before
    assert not [path for path in run.iterdir() if path.name.startswith(".")]


@pytest.mark.parametrize(
    "option",
    ["--at 3", "--seconds 3", "--size 64x64", "--camera side", "--theme dark", "--trial 3", "--seed 3"],
)
def test_an_option_of_what_is_not_asked_for_is_refused(run: Path, option: str) -> None:
    text = CliRunner().invoke(command, ["--run", str(run), *option.split()])
    option = option.split(maxsplit=1)[0]
    assert text.exit_code == 2 and option in text.output


def test_a_picture_without_a_driver_is_one_clear_line(
    run: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("WGPU_BACKEND", "vulkan")
    for name in ("VK_ICD_FILENAMES", "VK_DRIVER_FILES"):
        monkeypatch.setenv(name, "/nonexistent")
    with pytest.raises(SystemExit) as left:
        main(["view", "--run", str(run), "--screenshot", str(run.parent / "view.png")])
    assert left.value.code == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert "needs a Vulkan driver" in line
    assert [path.name for path in run.parent.iterdir()] == [run.name]


def frames_of(path: Path) -> tuple[list[np.ndarray], float]:
    """The pictures of a video, and its frame rate."""
    capture, pictures = cv2.VideoCapture(str(path)), []
    rate = capture.get(cv2.CAP_PROP_FPS)
    while (read := capture.read())[0]:
        pictures.append(read[1])
    capture.release()
    return pictures, rate


def test_a_video_is_the_film_in_real_time(run: Path, walk: Motion, capfd: pytest.CaptureFixture[str]) -> None:
    """A second of the rollout is a second of the film, with the pictures that `render_frames` draws."""
    movie = run.parent / "walk.webm"
    options = ["--seconds", "1", "--size", "160x120", "--camera", "side", "--theme", "dark"]
    with pytest.raises(SystemExit) as left:
        main(["view", "--run", str(run), "--video", str(movie), *options])
    assert not left.value.code
    text = capfd.readouterr()
    assert text.err == "" and text.out.splitlines()[1:] == [str(movie)]
    pictures, rate = frames_of(movie)
    movie.unlink()
    assert (len(pictures), rate) == (30, 30.0)
    scene = scene_of(loaded(run), walk)
    drawn = list(render_frames(scene, range(30), camera="side", size=(160, 120), theme="dark"))
    for frame in (0, 29):
        off = [np.abs(pictures[frame][..., ::-1].astype(int) - one).mean() for one in drawn]
        assert int(np.argmin(off)) == frame and off[frame] < 3


def test_a_video_is_never_longer_than_the_rollout(run: Path) -> None:
    movie = run.parent / "short.webm"
    arguments = ["--run", str(run), "--video", str(movie), "--size", "16x16", "--seconds", "500"]
    assert CliRunner().invoke(command, arguments).exit_code == 0
    assert len(frames_of(movie)[0]) == FRAMES
    movie.unlink()


@pytest.mark.parametrize("size", ["640", "0x0", "64x64x64", "99999x64", "-3x4"])
def test_a_size_that_is_none_is_refused(run: Path, size: str) -> None:
    text = CliRunner().invoke(command, ["--run", str(run), "--video", "w.webm", f"--size={size}"])
    assert text.exit_code == 2 and "expected WIDTHxHEIGHT from 16x16" in text.output


def test_a_video_of_another_kind_is_refused_before_anything_is_written(
    run: Path, tmp_path: Path, walk: Motion, performance: Callable[..., Trajectory]
) -> None:
    fill(tmp_path, walk, performance(1, 5))
    with pytest.raises(KinemimicError, match=r"expected a video named \.webm or \.mp4, found '\.gif'"):
        CliRunner().invoke(
            command, ["--run", str(tmp_path), "--video", str(tmp_path / "o.gif")], catch_exceptions=False
        )
    assert sorted(path.name for path in tmp_path.iterdir()) == ["motion.json", "trajectory.npz"]


def test_the_command_to_open_it_exists(tmp_path):
    viewer, *options = how_to_open(tmp_path / "view.rrd").removeprefix("open it with: ").split()
    assert shutil.which(viewer)
    # Without it, the viewer accepts connections from the network.
    assert options == ["--bind", "127.0.0.1", str(tmp_path / "view.rrd")]


def test_a_trial_of_a_scenario_needs_no_evaluation(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []
    monkeypatch.setattr("kinemimic.evaluate.scoring.evaluate.evaluate", lambda run: asked.append("evaluate"))
    monkeypatch.setattr(module, "_record_trial", lambda *_: (tmp_path / "view-room.rrd", None))
    arguments = ["--policy", "walk", "--run", str(tmp_path / "run"), "--scenario", "room"]
    result = CliRunner().invoke(command, arguments, catch_exceptions=False)
    assert result.exit_code == 0
    assert asked == []
