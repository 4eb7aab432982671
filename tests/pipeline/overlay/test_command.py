"""The decoded video shows the joints at their projected positions."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from numpy.typing import NDArray
from samples.depth_scene import AZURE, HALF, Lens, lens_toml, to_camera, walker, write_recording

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError, KinemimicError
from kinemimic.pipeline.ingest import ingest
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.pipeline.overlay import command as module
from kinemimic.pipeline.overlay.command import command, overlay

Picture = NDArray[np.uint8]

GREEN, ORANGE = (50, 90), (5, 20)  # hues as OpenCV counts them, of 180


def decoded(path: Path) -> list[Picture]:
    capture = cv2.VideoCapture(str(path))
    frames = []
    while (read := capture.read())[0]:
        frames.append(read[1])
    capture.release()
    return frames


def centroid(picture: Picture, pixel: Array, hues: tuple[int, int], reach: int = 8) -> Array:
    """Centre (2,) of the pixels of a colour around a pixel."""
    u, v = np.rint(pixel).astype(int)
    left, top = max(u - reach, 0), max(v - reach, 0)
    patch = cv2.cvtColor(picture[top : v + reach + 1, left : u + reach + 1], cv2.COLOR_BGR2HSV).astype(int)
    shown = (
        (patch[..., 0] >= hues[0]) & (patch[..., 0] <= hues[1]) & (patch[..., 1] > 120) & (patch[..., 2] > 90)
    )
    rows, columns = np.nonzero(shown)
    assert len(rows) >= 8
    return np.array([left + columns.mean(), top + rows.mean()])


def alone(pixels: Array, distance: float = 18.0) -> list[int]:
    """The joints whose discs do not overlap others."""
    gaps = np.linalg.norm(pixels[:, None] - pixels, axis=-1) + 1e3 * np.eye(len(pixels))
    return np.flatnonzero(gaps.min(axis=1) > distance).tolist()


def offsets(folder: Path, out: Path, expected: Array, states: NDArray[np.uint8]) -> Iterator[float]:
    """Distance in pixels between the drawn and the true position of every isolated joint."""
    for picture, pixels, state in zip(decoded(out), expected, states, strict=True):
        for joint in alone(pixels):
            if state[joint]:
                hues = GREEN if state[joint] == 2 else ORANGE
                yield float(np.linalg.norm(centroid(picture, pixels[joint], hues) - pixels[joint]))


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("overlay") / "walk"
    rng = np.random.default_rng(0)
    picture = rng.integers(90, 110, (AZURE.height, AZURE.width, 3)).astype(np.uint8)
    write_recording(folder, 40, lens=AZURE, color=dict.fromkeys(range(1, 40, 2), picture))
    return folder


@pytest.mark.parametrize("view", ["depth", "color"])
def test_decoded_joints_are_within_a_pixel(walk: Path, tmp_path: Path, view: str) -> None:
    out = tmp_path / "o.webm"
    drawn = overlay(walk, out, view=view)
    assert (drawn.frames, drawn.view, drawn.joints) == (40, view, 40 * 20)
    states = module.read_recording(walk).states
    off = np.array(list(offsets(walk, out, AZURE.project(to_camera(walker(40))), states)))
    assert len(off) > 200
    assert off.max() < 1.0
    assert [path.name for path in tmp_path.iterdir()] == ["o.webm"]


def test_colour_through_a_camera_of_its_own(tmp_path: Path) -> None:
    own = Lens(480, 360, 330.0, 332.0, 241.0, 178.0, (0.1, -0.15, 1e-3, -5e-4, 0.02, 0.0, 0.0, 0.0))
    turn = np.radians(4.0)
    rotation = np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])
    shift = np.array([-0.05, 0.01, 0.02])
    folder, frames = tmp_path / "walk", 12
    picture = np.full((own.height, own.width, 3), 80, dtype=np.uint8)
    joints = write_recording(folder, frames, rendered=False, color=dict.fromkeys(range(frames), picture))
    pose = f"rotation = {rotation.ravel().tolist()}\ntranslation = {shift.tolist()}\n"
    with (folder / "camera.toml").open("a") as stream:
        stream.write(f"[color]\n{pose}{lens_toml(own, 'color.')}")
    out = tmp_path / "o.webm"
    assert overlay(folder, out).view == "color"
    expected = own.project(to_camera(joints) @ rotation.T + shift)
    states = module.read_recording(folder).states
    off = list(offsets(folder, out, expected, states))
    assert len(off) >= 20
    assert max(off) < 1.0


def test_a_joint_without_depth_is_not_drawn(tmp_path: Path) -> None:
    pixels = HALF.project(to_camera(walker(8)))
    hand = NODES.index("hand_left")

    def damage(frame: int, image: NDArray[np.uint16]) -> NDArray[np.uint16]:
        u, v = np.rint(pixels[frame, hand]).astype(int)
        image[v - 7 : v + 8, u - 7 : u + 8] = 0
        return image

    write_recording(tmp_path / "walk", 8, damage=damage)
    lost = int((module.read_recording(tmp_path / "walk").states == 0).sum())
    assert lost >= 8
    assert overlay(tmp_path / "walk", tmp_path / "o.webm").joints == 8 * 20 - lost


def test_a_run_is_drawn_and_must_be_of_this_recording(tmp_path: Path) -> None:
    folder, run = tmp_path / "walk", tmp_path / "run"
    write_recording(folder, 40, rendered=False)
    ingest(folder, run)
    runner = CliRunner()
    out = tmp_path / "new" / "o.webm"
    result = runner.invoke(command, [str(folder), "--run", str(run), "--out", str(out), "--json"])
    assert result.exit_code == 0
    assert json.loads(result.stdout) == {"path": out.as_posix(), "view": "depth", "frames": 40, "joints": 800}
    # By default, it is in the run folder, where its report looks for it.
    result = runner.invoke(command, [str(folder), "--run", str(run)], catch_exceptions=False)
    assert result.stdout.startswith((run / "overlay.webm").as_posix())
    folder.rename(tmp_path / "other")
    with pytest.raises(KinemimicError, match="expected a run of other, found one of walk"):
        overlay(tmp_path / "other", out, run=run)


def test_bad_input_is_one_line(tmp_path: Path) -> None:
    folder, out = tmp_path / "walk", tmp_path / "o.webm"
    write_recording(folder, 3, rendered=False)
    with pytest.raises(CaptureError, match="found no colour images"):
        overlay(folder, out, view="color")
    with pytest.raises(CaptureError, match=r"a folder with a camera\.toml"):
        overlay(tmp_path, out)
    with pytest.raises(KinemimicError, match=r"expected a video named \.webm or \.mp4"):
        overlay(folder, tmp_path / "o.gif")
    for path in (folder / "depth").iterdir():
        path.write_bytes(path.read_bytes()[:-30])
    with pytest.raises(CaptureError, match="cut off"):
        overlay(folder, out)
    assert [path.name for path in tmp_path.iterdir()] == ["walk"]


def test_ctrl_c_leaves_the_old_video_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, out = tmp_path / "walk", tmp_path / "o.webm"
    write_recording(folder, 5, rendered=False)
    out.write_bytes(b"the video of yesterday")
    calls = iter(range(3))

    def interrupted(*_: object) -> None:
        if next(calls, None) is None:
            raise KeyboardInterrupt

    monkeypatch.setattr(module, "draw_caption", interrupted)
    with pytest.raises(KeyboardInterrupt):
        overlay(folder, out)
    assert out.read_bytes() == b"the video of yesterday"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["o.webm", "walk"]


def test_a_full_disk_is_one_line_and_leaves_nothing(tmp_path: Path) -> None:
    folder = tmp_path / "walk"
    write_recording(folder, 40, rendered=False)
    code = f"""
import resource
from kinemimic.pipeline.cli.main import main
resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))  # files end where a full disk would end them
main(["overlay", {str(folder)!r}, "--out", {str(tmp_path / "o.webm")!r}])
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 2
    assert done.stderr.strip().splitlines() == [done.stderr.strip()]
    assert re.search(r"expected a video of 40 frames, found \d+ in it; is the disk full\?", done.stderr)
    assert [path.name for path in tmp_path.iterdir()] == ["walk"]
