"""The landmarks of a clip, and the file in which they are kept."""

from __future__ import annotations

import io
import struct
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.files.store import atomic
from kinemimic.pipeline.files.validation.bounded import MEGABYTE, read_bounded
from kinemimic.pipeline.video.decode import MAX_FRAMES
from kinemimic.pipeline.video.landmarks import COUNT
from kinemimic.pipeline.video.region import Region
from kinemimic.pipeline.video.track import Followed

_SCHEMA = 2
# 864,000 frames of 33 points in single precision.
_LIMIT = 1024 * MEGABYTE
# What zipfile and numpy raise on damaged archives, one or another.
_DAMAGED = (
    OSError, ValueError, KeyError, IndexError, TypeError, EOFError, RuntimeError, MemoryError, OverflowError,
    zipfile.BadZipFile, zlib.error, struct.error,
)  # fmt: skip


@dataclass(frozen=True)
class LandmarkTrack:
    """33 landmarks in the first T frames of a video, NaN and zero in frames without the person.

    times: (T,) seconds; pixels: (T, 33, 2); world: (T, 33, 3) metres, as in `Landmarks`; visibility:
    (T, 33); size: (width, height) of the images; key: of the video, the models and the person; done: whether
    the video has no more frames; followed: how far the person was, to go on from there; people: the most
    people seen in one frame.
    """

    times: Array
    pixels: Array
    world: Array
    visibility: Array
    size: tuple[int, int]
    key: str
    done: bool
    followed: Followed
    people: int


def write_track(path: Path, track: LandmarkTrack) -> None:
    """Write a track atomically, as arrays in single precision (times in double)."""
    buffer = io.BytesIO()
    last = track.followed.last
    np.savez_compressed(
        buffer,
        schema=np.int64(_SCHEMA),
        times=track.times,
        pixels=track.pixels.astype(np.float32),
        world=track.world.astype(np.float32),
        visibility=track.visibility.astype(np.float32),
        size=np.array(track.size, dtype=np.int64),
        key=np.frombuffer(track.key.encode("ascii"), dtype=np.uint8),
        done=np.array([track.done]),
        last=np.full(4, np.nan) if last is None else np.array([*last.centre, last.side, last.angle]),
        lost=np.int64(track.followed.lost),
        people=np.int64(track.people),
    )
    with atomic(path) as temporary:
        temporary.write_bytes(buffer.getvalue())


def read_track(path: Path, key: str) -> LandmarkTrack | None:
    """The track in a file, None if there is none, if it is damaged, or of another video, model or person."""
    try:
        content = io.BytesIO(read_bounded(path, _LIMIT, "a file of landmarks"))
        with zipfile.ZipFile(content) as archive:
            if sum(one.file_size for one in archive.infolist()) > _LIMIT:
                return None
        with np.load(content, allow_pickle=False) as file:
            if int(file["schema"]) != _SCHEMA or bytes(file["key"]).decode("ascii", "replace") != key:
                return None
            times = _numbers(file["times"], (len(file["times"]),))
            T = len(times)
            if not 0 < T <= MAX_FRAMES or not (np.diff(times) > 0.0).all():
                return None
            width, height = (int(value) for value in file["size"])
            return LandmarkTrack(
                times=times,
                pixels=_numbers(file["pixels"], (T, COUNT, 2)),
                world=_numbers(file["world"], (T, COUNT, 3)),
                visibility=_numbers(file["visibility"], (T, COUNT)),
                size=(width, height),
                key=key,
                done=bool(file["done"][0]),
                followed=_followed(_numbers(file["last"], (4,)), int(file["lost"]), T),
                people=int(file["people"]),
            )
    except _DAMAGED:
        return None


def _followed(last: Array, lost: int, frames: int) -> Followed:
    """From where the person was last expected (x, y, side, angle), NaN if nowhere."""
    if not 0 <= lost <= frames:
        raise ValueError("another file")
    x, y, side, angle = last.tolist()
    return Followed(Region(np.array([x, y]), side, angle) if np.isfinite(last).all() else None, lost, frames)


def _numbers(values: NDArray[np.generic], shape: tuple[int, ...]) -> Array:
    if values.shape != shape or values.dtype.kind != "f":
        raise ValueError("another file")
    return values.astype(np.float64)
