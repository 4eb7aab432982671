"""Videos play in browsers, keep every frame and the clock, and appear only when they are complete."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files import video as module
from kinemimic.pipeline.files.video import require_encoder, video

GREY = np.full((48, 64, 3), 200, dtype=np.uint8)


def write(path: Path, rate: float = 30.0, frames: int = 3) -> None:
    with video(path, 64, 48, rate) as film:
        for _ in range(frames):
            film.add(GREY)


def test_a_video_is_webm_of_vp8(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    write(tmp_path / "o.webm", frames=30)
    # An EBML header with the document type of WebM, and the codec as its track names it.
    head = (tmp_path / "o.webm").read_bytes()[:1000]
    assert head[:4] == b"\x1aE\xdf\xa3" and b"webm" in head and b"V_VP8" in head
    capture = cv2.VideoCapture(str(tmp_path / "o.webm"))
    assert capture.get(cv2.CAP_PROP_FRAME_COUNT) / capture.get(cv2.CAP_PROP_FPS) == pytest.approx(1.0)
    capture.release()
    assert capfd.readouterr() == ("", "")  # nothing of OpenCV's on the terminal


def test_odd_sizes_and_odd_rates_lose_nothing(tmp_path: Path) -> None:
    grey = GREY[:47, :63]
    with video(tmp_path / "o.webm", 63, 47, 12.345) as film:
        film.add(grey)
        film.add(grey)
    capture = cv2.VideoCapture(str(tmp_path / "o.webm"))
    first, second, third = (capture.read() for _ in range(3))
    capture.release()
    assert second[0] and not third[0]
    assert first[1].shape == (48, 64, 3)
    assert np.abs(first[1][:46, :62].astype(int) - 200).max() < 12
    assert first[1][47, :60].max() < 60


@pytest.mark.parametrize(
    ("rate", "expected"), [(1 / 0.015, 66.67), (333.3333, 333.3), (29.97003, 29.97), (0.0004, 0.1)]
)
def test_every_clock_has_a_rate_that_the_codec_takes(tmp_path: Path, rate: float, expected: float) -> None:
    write(tmp_path / "o.webm", rate)
    capture = cv2.VideoCapture(str(tmp_path / "o.webm"))
    assert capture.get(cv2.CAP_PROP_FPS) == pytest.approx(expected, rel=1e-4)
    capture.release()


@pytest.mark.parametrize("name", ["o.gif", "o.avi", "o"])
def test_another_ending_is_refused_before_work_begins(tmp_path: Path, name: str) -> None:
    for write_or_ask in (write, require_encoder):
        with pytest.raises(KinemimicError, match=r"expected a video named \.webm or \.mp4"):
            write_or_ask(tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_mp4_without_an_encoder_is_one_line_that_names_webm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(module.CODECS, ".mp4", ("none",))
    for write_or_ask in (write, require_encoder):
        with pytest.raises(KinemimicError, match=r"an encoder for H\.264, found none; name it \*\.webm"):
            write_or_ask(tmp_path / "o.mp4")
    assert not list(tmp_path.iterdir())
    assert capfd.readouterr() == ("", "")


def test_the_second_encoder_is_taken_where_the_first_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(module.CODECS, ".webm", ("none", "VP90"))
    write(tmp_path / "o.webm")
    assert b"V_VP9" in (tmp_path / "o.webm").read_bytes()[:1000]


def test_an_interruption_leaves_the_old_video_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "o.webm"
    path.write_bytes(b"the video of yesterday")
    with pytest.raises(KeyboardInterrupt), video(path, 64, 48, 30.0) as film:
        film.add(GREY)
        raise KeyboardInterrupt
    assert path.read_bytes() == b"the video of yesterday"
    assert [one.name for one in tmp_path.iterdir()] == ["o.webm"]
