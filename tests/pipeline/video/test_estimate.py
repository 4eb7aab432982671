"""Videos are decoded frame by frame, and what was seen in them is kept and continued."""

from __future__ import annotations

import multiprocessing
import subprocess
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kinemimic.pipeline.errors import CaptureError, KinemimicError
from kinemimic.pipeline.files.video import video
from kinemimic.pipeline.readers.video.container import is_video
from kinemimic.pipeline.video import estimate, models, network
from kinemimic.pipeline.video.decode import frames
from kinemimic.pipeline.video.detector import Detection
from kinemimic.pipeline.video.estimate import PoseOptions, landmark_track
from kinemimic.pipeline.video.landmark_track import LandmarkTrack, read_track, write_track
from kinemimic.pipeline.video.landmarks import Landmarks
from kinemimic.pipeline.video.region import Region
from kinemimic.pipeline.video.track import Followed

FRAMES, RATE = 24, 25.0
PLACE = Region(np.array([80.0, 60.0]), 100.0, 0.0)


@pytest.fixture
def clip(tmp_path: Path) -> Path:
    """A bright square that moves 5 pixels a frame."""
    path = tmp_path / "clip.webm"
    with video(path, 160, 120, RATE) as film:
        for k in range(FRAMES):
            image = np.zeros((120, 160, 3), dtype=np.uint8)
            image[40:80, 5 * k : 5 * k + 30] = 255
            film.add(image)
    return path


class Eye:
    """Both networks: sees the square's left edge, and stops the program at a frame."""

    def __init__(self, stop: int = 10**9) -> None:
        self.frame, self.stop = 0, stop

    def people(self, image: np.ndarray) -> list[Detection]:
        return [Detection(0.9, np.zeros(4), np.array([80.0, 60.0]), np.array([80.0, 20.0]))]

    def __call__(self, image: np.ndarray, region: Region) -> Landmarks:
        self.frame += 1
        if self.frame > self.stop:
            raise KeyboardInterrupt
        left = float(np.flatnonzero(image[60, :, 0] > 127)[0])
        return Landmarks(0.9, np.full((33, 2), left), np.full((33, 3), left), np.ones(33), region)


def looking(monkeypatch: pytest.MonkeyPatch, eye: Eye) -> Eye:
    monkeypatch.setattr(estimate, "_networks", lambda options: (eye, eye, "models"))
    return eye


def test_every_frame_comes_in_order_with_its_time(clip: Path) -> None:
    found = list(frames(clip))
    assert [one.number for one in found] == list(range(FRAMES))
    assert [one.time for one in found] == pytest.approx(np.arange(FRAMES) / RATE, abs=2e-3)
    later = list(frames(clip, skip=20))
    assert [one.number for one in later] == [20, 21, 22, 23]
    assert (later[0].image == found[20].image).all() and later[0].time == found[20].time


@pytest.mark.parametrize("content", [b"", b"no video at all", b"\x1aE\xdf\xa3" + bytes(500)])
def test_what_is_no_video_is_one_error(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "walk.mp4"
    path.write_bytes(content)
    with pytest.raises(CaptureError, match="expected a video"):
        list(frames(path))


def test_a_video_is_known_by_its_first_bytes(clip: Path, tmp_path: Path) -> None:
    renamed = tmp_path / "walk.skl"
    renamed.write_bytes(clip.read_bytes())
    assert is_video(renamed)
    (tmp_path / "text.mp4").write_text("HIERARCHY")
    assert not is_video(tmp_path / "text.mp4")
    assert not is_video(tmp_path / "absent.mp4") and not is_video(tmp_path)


def test_a_cut_off_video_gives_the_frames_it_has(clip: Path, tmp_path: Path) -> None:
    short = tmp_path / "short.webm"
    short.write_bytes(clip.read_bytes()[: clip.stat().st_size // 2])
    assert 0 < len(list(frames(short))) < FRAMES


def test_an_interrupted_estimate_goes_on_where_it_was(
    clip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = tmp_path / "run" / "landmarks.npz"
    looking(monkeypatch, Eye())
    whole = landmark_track(clip, "sha", PoseOptions(), None)
    looking(monkeypatch, Eye(stop=10))
    with pytest.raises(KeyboardInterrupt, match="10 frames are in"):
        landmark_track(clip, "sha", PoseOptions(), kept)
    eye = looking(monkeypatch, Eye())
    resumed = landmark_track(clip, "sha", PoseOptions(), kept)
    assert eye.frame == FRAMES - 10
    assert resumed.pixels == pytest.approx(whole.pixels) and resumed.times == pytest.approx(whole.times)
    assert whole.pixels[:, 0, 0] == pytest.approx(5.0 * np.arange(FRAMES), abs=2.0)
    again = looking(monkeypatch, Eye())
    landmark_track(clip, "sha", PoseOptions(), kept)
    assert again.frame == 0
    landmark_track(clip, "sha", PoseOptions(person=1), kept)
    assert again.frame == FRAMES


def test_a_later_call_gives_the_same_numbers(
    clip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    eye = looking(monkeypatch, Eye())
    third = Landmarks(0.9, np.full((33, 2), 1 / 3), np.full((33, 3), 1 / 3), np.full(33, 1 / 3), PLACE)
    monkeypatch.setattr(Eye, "__call__", lambda *_: third)
    kept = tmp_path / "landmarks.npz"
    first, later = (landmark_track(clip, "sha", PoseOptions(), kept) for _ in range(2))
    for name in ("times", "pixels", "world", "visibility"):
        assert (getattr(first, name) == getattr(later, name)).all(), name
    assert eye.frame == 0


class Crowd(Eye):
    """A person who leaves after six frames, and a stranger, far away, who stays."""

    def people(self, image: np.ndarray) -> list[Detection]:
        left = float(np.flatnonzero(image[60, :, 0] > 127)[0])
        if left > self.stop:
            raise KeyboardInterrupt
        places = (40.0, 130.0) if left < 28.0 else (130.0,)
        return [Detection(0.9, np.zeros(4), np.array([x, 60.0]), np.array([x, 50.0])) for x in places]

    def __call__(self, image: np.ndarray, region: Region) -> Landmarks:
        found = Eye().__call__(image, region)
        gone = region.centre[0] < 80.0 and found.pixels[0, 0] > 28.0
        return replace(found, score=0.1 if gone else 0.9)


def test_an_estimate_that_is_interrupted_while_the_person_is_lost_follows_nobody_else(
    clip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = tmp_path / "landmarks.npz"
    looking(monkeypatch, Crowd())
    whole = landmark_track(clip, "sha", PoseOptions(), None)
    assert np.isfinite(whole.pixels[:6]).all() and np.isnan(whole.pixels[6:]).all()
    looking(monkeypatch, Crowd(stop=60))
    with pytest.raises(KeyboardInterrupt, match="frames are in"):
        landmark_track(clip, "sha", PoseOptions(), kept)
    looking(monkeypatch, Crowd())
    resumed = landmark_track(clip, "sha", PoseOptions(), kept)
    assert np.array_equal(resumed.pixels, whole.pixels, equal_nan=True)


@pytest.mark.parametrize("daemon", [False, True])
def test_in_a_worker_process_the_networks_have_one_thread(
    daemon: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, threads = tmp_path / "model.tflite", []
    model.write_bytes(b"")
    monkeypatch.setitem(vars(multiprocessing.current_process())["_config"], "daemon", daemon)
    monkeypatch.setattr(estimate.os, "sched_getaffinity", lambda _: range(5))
    monkeypatch.setattr(estimate, "require_runtime", lambda: None)
    monkeypatch.setattr(estimate, "model_files", lambda: (model, model))
    monkeypatch.setattr(estimate, "Network", lambda *_, **given: threads.append(given["threads"]))
    estimate._networks(PoseOptions())
    assert threads == ([1, 1] if daemon else [5, 5])


def test_a_video_without_a_person_is_an_error(clip: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    eye = looking(monkeypatch, Eye())
    monkeypatch.setattr(eye, "people", lambda image: [])
    with pytest.raises(CaptureError, match="expected a person in the video, found none"):
        landmark_track(clip, "sha", PoseOptions(), None)
    looking(monkeypatch, Eye())
    with pytest.raises(CaptureError, match="person 3 from the left in the video, found at most 1"):
        landmark_track(clip, "sha", PoseOptions(person=3), None)


def track(frames: int) -> LandmarkTrack:
    rng = np.random.default_rng(0)
    return LandmarkTrack(
        times=np.arange(frames) / 30.0,
        pixels=rng.normal(size=(frames, 33, 2)),
        world=rng.normal(size=(frames, 33, 3)),
        visibility=rng.uniform(size=(frames, 33)),
        size=(720, 1280),
        key="key",
        done=True,
        followed=Followed(),
        people=2,
    )


def test_a_track_comes_back_as_it_was_written(tmp_path: Path) -> None:
    path, written = tmp_path / "landmarks.npz", track(9)
    write_track(path, written)
    found = read_track(path, "key")
    assert found is not None and found.pixels == pytest.approx(written.pixels, abs=1e-5)
    assert replace(found, pixels=written.pixels).size == (720, 1280) and found.done and found.people == 2
    assert read_track(path, "another key") is None and read_track(tmp_path / "absent.npz", "key") is None


def test_a_damaged_track_counts_as_none(tmp_path: Path) -> None:
    path = tmp_path / "landmarks.npz"
    write_track(path, track(9))
    content = bytearray(path.read_bytes())
    rng = np.random.default_rng(0)
    for _ in range(300):
        damaged = bytearray(content[: rng.integers(0, len(content))] if rng.random() < 0.3 else content)
        for at in rng.integers(0, max(len(damaged), 1), 3):
            damaged[at : at + 1] = bytes([rng.integers(0, 256)])
        path.write_bytes(damaged)
        found = read_track(path, "key")
        assert found is None or len(found.pixels) == len(found.times)


def test_without_the_extra_one_line_says_how_to_install_it(
    clip: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(network, "find_spec", lambda name: None)
    with pytest.raises(KinemimicError, match=r"pip install 'kinemimic\[video\]'"):
        landmark_track(clip, "sha", PoseOptions(), None)


def test_without_a_package_index_one_line_says_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    failed = subprocess.CompletedProcess([], 1, "", "ERROR: No matching distribution found")
    monkeypatch.setattr(models.subprocess, "run", lambda *_, **__: failed)
    with pytest.raises(KinemimicError, match=r"pip reports: No matching .*; connect once, or put") as error:
        models.model_files(tmp_path)
    assert "\n" not in str(error.value)


def test_a_wheel_with_other_models_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    wheel = tmp_path / "other.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        for model in (models.DETECTOR, models.LANDMARKS):
            archive.writestr(model.file, b"something else")
    monkeypatch.setattr(models, "_download", lambda scratch, folder: wheel)
    with pytest.raises(KinemimicError, match="as published, found another file"):
        models.model_files(tmp_path / "models")
    assert not list((tmp_path / "models").glob("*"))


def test_a_file_that_is_no_model_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("ai_edge_litert")
    path = tmp_path / "own.tflite"
    path.write_bytes(b"not a model" * 100)
    with pytest.raises(KinemimicError, match="expected a TensorFlow Lite model, found another file"):
        network.Network(path, input_side=256, output_sizes={1}, threads=1)
