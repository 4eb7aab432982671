"""Two thousand damaged videos, and as many damaged files of landmarks: each gives one clear line or a valid
result, in bounded time and memory.

The videos are read whole, through decoder, tracker and fit, with a network that sees a person wherever the
figure in the image is.
"""

from __future__ import annotations

import faulthandler
import resource
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from peers.films import CODECS, film
from samples.mutate import mutated

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.skeleton import MISSING
from kinemimic.pipeline.readers.recognise import read
from kinemimic.pipeline.video import estimate
from kinemimic.pipeline.video.decode import Image
from kinemimic.pipeline.video.detector import Detection
from kinemimic.pipeline.video.landmark_track import LandmarkTrack, read_track, write_track
from kinemimic.pipeline.video.landmarks import Landmarks
from kinemimic.pipeline.video.region import Region
from kinemimic.pipeline.video.track import Followed

FRAMES = 12
# A hang, not slowness, is what is looked for: most take a hundredth of a second.
SECONDS = 30
MEMORY = 500 * 2**20
# Landmark: where it is in the figure, in its heights to the right of its middle and below its top.
FIGURE: dict[int, tuple[float, float]] = {
    0: (0.02, 0.06), 7: (-0.02, 0.07), 8: (0.02, 0.07), 11: (-0.1, 0.18), 12: (0.1, 0.18), 13: (-0.14, 0.36),
    14: (0.14, 0.36), 15: (-0.15, 0.5), 16: (0.15, 0.5), 23: (-0.05, 0.5), 24: (0.05, 0.5), 25: (-0.05, 0.73),
    26: (0.05, 0.73), 27: (-0.05, 0.95), 28: (0.05, 0.95), 29: (-0.06, 0.98), 30: (0.06, 0.98),
    31: (-0.02, 0.99), 32: (0.09, 0.99),
}  # fmt: skip


class Eye:
    """Both networks: a person about the brightest column of the image, if there is one."""

    def people(self, image: Image) -> list[Detection]:
        height, width = image.shape[:2]
        middle = np.array([width / 2.0, height / 2.0])
        return [Detection(0.9, np.zeros(4), middle, middle - [0.0, height / 2.0])]

    def __call__(self, image: Image, region: Region) -> Landmarks:
        height = image.shape[0]
        x = float(np.argmax(image[..., 2].astype(np.float64).sum(axis=0)))
        share = np.tile([0.0, 0.5], (33, 1))
        for landmark, place in FIGURE.items():
            share[landmark] = place
        world = np.concatenate([1.7 * (share - [0.0, 0.5]), np.zeros((33, 1))], axis=1)
        return Landmarks(0.9, [x, 0.0] + share * height, world, np.full(33, 0.9), region)


@pytest.fixture(autouse=True)
def bounds(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Any input that hangs ends the test with its traceback; growing memory fails it."""
    eye = Eye()
    monkeypatch.setattr(estimate, "_networks", lambda options: (eye, eye, "models"))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    yield
    faulthandler.cancel_dump_traceback_later()
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024
    assert grown < MEMORY


def damaged(content: bytes, rng: np.random.Generator) -> bytes:
    """Bytes overwritten in place, which leaves most of a video's tables as they were; or any mutation."""
    if rng.random() < 0.5:
        return mutated(content, rng)
    out = bytearray(content)
    for _ in range(int(rng.integers(1, 6))):
        at = int(rng.integers(len(out)))
        new = rng.bytes(int(rng.integers(1, 1 + min(16, len(out) - at))))
        out[at : at + len(new)] = new
    return bytes(out)


def survives(ending: str, inputs: int, folder: Path) -> None:
    """Read so many damaged copies of a video; some must be readable, and others not."""
    path = film(folder / f"walk{ending}", FRAMES)
    content, rng = path.read_bytes(), np.random.default_rng(2026)
    clips = errors = 0
    for number in range(inputs):
        path.write_bytes(damaged(content, rng))
        faulthandler.dump_traceback_later(SECONDS, exit=True)
        try:
            clip = read(path)
        except KinemimicError as error:
            assert len(str(error).splitlines()) == 1 and len(str(error)) < 1000
            errors += 1
        except Exception as error:
            error.add_note(f"input {number} of {ending}, kept in {path}")
            raise
        else:
            assert len(clip.times) > 0 and (np.diff(clip.times) > 0).all() and np.isfinite(clip.times).all()
            missing = clip.states == MISSING
            assert np.isnan(clip.positions[missing]).all() and np.isfinite(clip.positions[~missing]).all()
            clips += 1
    assert clips > inputs // 20 and errors > inputs // 20


def test_the_video_as_it_was_written_is_a_capture(tmp_path: Path) -> None:
    for ending in CODECS:
        clip = read(film(tmp_path / f"walk{ending}", FRAMES))
        assert len(clip.times) == FRAMES and (clip.states != MISSING).all()


@pytest.mark.parametrize("ending", CODECS)
def test_damaged_videos(ending: str, tmp_path: Path) -> None:
    survives(ending, 30, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("ending", CODECS)
def test_two_thousand_damaged_videos(ending: str, tmp_path: Path) -> None:
    survives(ending, 2000, tmp_path)


@pytest.mark.parametrize("inputs", [300, pytest.param(2000, marks=pytest.mark.slow)])
def test_damaged_files_of_landmarks(inputs: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    path = tmp_path / "landmarks.npz"
    T = 9
    track = LandmarkTrack(
        times=np.arange(T) / 30.0,
        pixels=rng.normal(size=(T, 33, 2)),
        world=rng.normal(size=(T, 33, 3)),
        visibility=rng.uniform(size=(T, 33)),
        size=(720, 1280),
        key="key",
        done=True,
        followed=Followed(),
        people=1,
    )
    write_track(path, track)
    assert read_track(path, "key") is not None
    content, none = path.read_bytes(), 0
    for _ in range(inputs):
        path.write_bytes(mutated(content, rng))
        faulthandler.dump_traceback_later(SECONDS, exit=True)
        found = read_track(path, "key")
        if found is None:
            none += 1
            continue
        assert (np.diff(found.times) > 0.0).all()
        assert found.pixels.shape == (len(found.times), 33, 2)
    assert none > inputs // 5
