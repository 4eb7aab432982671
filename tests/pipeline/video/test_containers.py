"""What a container says of its frames: how they are turned, when they were seen, and how many there are."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from peers.films import RATE, film, timed, turned
from peers.films import counted as counted_frames

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.cli.progress import reported_to
from kinemimic.pipeline.cli.progress_state import ProgressState
from kinemimic.pipeline.video import estimate
from kinemimic.pipeline.video.decode import Image, frames
from kinemimic.pipeline.video.detector import Detection
from kinemimic.pipeline.video.estimate import PoseOptions, landmark_track
from kinemimic.pipeline.video.landmarks import Landmarks
from kinemimic.pipeline.video.region import Region

FRAMES = 12


@pytest.fixture(scope="module")
def content(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return film(tmp_path_factory.mktemp("film") / "walk.mp4", FRAMES).read_bytes()


class Eye:
    """Both networks: a person at a fixed place."""

    def people(self, image: Image) -> list[Detection]:
        return [Detection(0.9, np.zeros(4), np.array([48.0, 32.0]), np.array([48.0, 4.0]))]

    def __call__(self, image: Image, region: Region) -> Landmarks:
        return Landmarks(0.9, np.full((33, 2), 20.0), np.zeros((33, 3)), np.ones(33), region)


def head_and_legs(image: Image) -> tuple[Array, Array]:
    """Mean row and column of the red head and trunk, and of the blue legs."""
    redder = image[..., 2].astype(int) - image[..., 0]
    return np.argwhere(redder > 80).mean(axis=0), np.argwhere(redder < -80).mean(axis=0)


@pytest.mark.parametrize("quarters", [0, 1, 2, 3])
def test_a_turned_video_is_shown_as_its_flag_says(quarters: int, content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "walk.mp4"
    path.write_bytes(content)
    plain = next(frames(path)).image
    path.write_bytes(turned(content, quarters))
    shown = next(frames(path)).image
    assert shown.shape == ((64, 96, 3), (96, 64, 3))[quarters % 2]
    assert (shown == np.rot90(plain, -quarters)).all()
    # What stands in the image turned back by hand stood so before.
    head, legs = head_and_legs(np.rot90(shown, quarters))
    assert head[0] < legs[0] and head[1] == pytest.approx(legs[1], abs=2.0)


def test_frames_of_an_uneven_clock_keep_their_times(content: bytes, tmp_path: Path) -> None:
    seconds = [0.04, 0.04, 0.12, 0.04, 0.5, 0.04, 0.04, 0.04, 0.033, 0.017, 0.04, 0.04]
    path = tmp_path / "walk.mp4"
    path.write_bytes(timed(content, seconds))
    found = list(frames(path))
    times = np.concatenate([[0.0], np.cumsum(seconds)[:-1]])
    assert [one.time for one in found] == pytest.approx(times, abs=1e-3)
    # And after a part that is skipped.
    assert [one.time for one in frames(path, skip=7)] == pytest.approx(times[7:], abs=1e-3)


def test_frames_without_a_length_come_one_step_after_the_other(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "walk.mp4"
    path.write_bytes(timed(content, [1.0 / RATE] * 6 + [0.0] * 6))
    times = [one.time for one in frames(path)]
    assert len(times) == FRAMES and (np.diff(times) > 0.0).all()
    assert times[:7] == pytest.approx(np.arange(7) / RATE, abs=1e-3)


@pytest.mark.parametrize("claimed", [0, 1, 5, 300, 2**31])
def test_progress_ends_at_the_frames_that_there_are(claimed: int, content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "walk.mp4"
    path.write_bytes(counted_frames(content, claimed))
    watched(path)


@pytest.mark.parametrize("stated", [math.inf, 1.0, 5.0, 300.0])
def test_progress_of_any_stated_number(
    stated: float, content: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "walk.mp4"
    path.write_bytes(content)
    monkeypatch.setattr(estimate, "expected_frames", lambda _: stated)
    seen = watched(path)
    if stated > FRAMES:
        return
    # More frames than stated: how far it is, is not known, and no time is said to be left.
    over = [one for one in seen if stated < one.done < FRAMES]
    assert over and all(one.percent == "" and one.left is None for one in over)
    assert str(over[0]).startswith(f"pose: {over[0].done:.0f} frames")


def watched(path: Path) -> list[ProgressState]:
    """The states of progress while a person is looked for; the last says how many frames there were."""
    seen: list[ProgressState] = []
    with pytest.MonkeyPatch.context() as patch, reported_to(seen.append):
        eye = Eye()
        patch.setattr(estimate, "_networks", lambda options: (eye, eye, "models"))
        track = landmark_track(path, "sha", PoseOptions(), None)
    assert len(track.times) == FRAMES and (np.diff(track.times) > 0.0).all()
    # Where the stated number is reached it may look like the end, once.
    early = [one for one in seen if one.done < FRAMES and one.remaining.startswith("took")]
    assert len(early) <= 1 and all(one.done == one.total for one in early)
    assert seen[-1].done == seen[-1].total == FRAMES and seen[-1].percent == "100 %"
    return seen
