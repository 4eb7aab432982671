"""Find the landmarks in every frame of a video; what was found is kept, so that a later call goes on."""

from __future__ import annotations

import hashlib
import math
import multiprocessing
import os
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.files.store import file_hash
from kinemimic.pipeline.video.decode import expected_frames, frames
from kinemimic.pipeline.video.detector import OUTPUTS as DETECTOR_OUTPUTS
from kinemimic.pipeline.video.detector import SIDE as DETECTOR_SIDE
from kinemimic.pipeline.video.detector import Detector
from kinemimic.pipeline.video.landmark_track import LandmarkTrack, read_track, write_track
from kinemimic.pipeline.video.landmarks import COUNT, LandmarkNetwork, Landmarks
from kinemimic.pipeline.video.landmarks import OUTPUTS as LANDMARK_OUTPUTS
from kinemimic.pipeline.video.landmarks import SIDE as LANDMARK_SIDE
from kinemimic.pipeline.video.models import model_files
from kinemimic.pipeline.video.network import Network, require_runtime
from kinemimic.pipeline.video.track import PersonTracker

# Seconds between two writes of what was found so far.
_KEEP_EVERY = 20.0


@dataclass(frozen=True)
class PoseOptions:
    """person: number from the left, or None for the largest; model: a landmark network of one's own (a
    BlazePose .tflite, of 256x256 pixels), or None."""

    person: int | None = None
    model: Path | None = None


def landmark_track(path: Path, sha256: str, options: PoseOptions, kept: Path | None) -> LandmarkTrack:
    """The landmarks of one person in every frame of a video.

    sha256: of the video; kept: file to continue from and to write to, or None. Ctrl-C writes what was found
    and says so. CaptureError for a video that does not decode, or without a person; KinemimicError without
    the extra `video` or the models.
    """
    detector, network, models = _networks(options)
    key = hashlib.sha256(f"{sha256} {models} {options.person}".encode()).hexdigest()
    before = None if kept is None else read_track(kept, key)
    if before is not None and before.done:
        return before
    followed = None if before is None else before.followed
    tracker = PersonTracker(detector, network, person=options.person, followed=followed)
    found = _Found(before)
    total = expected_frames(path)
    if total < len(found.times):
        total = math.inf
    written = time.monotonic()
    try:
        with progress("pose", total, done=len(found.times), unit="frames") as bar:
            for frame in frames(path, skip=len(found.times)):
                found.add(frame.time, tracker(frame.image), (frame.image.shape[1], frame.image.shape[0]))
                if len(found.times) > total:
                    # The container states too few.
                    total = math.inf
                    bar.corrected(total)
                bar.advance()
                if kept is not None and time.monotonic() - written > _KEEP_EVERY:
                    write_track(kept, found.track(key, tracker, done=False))
                    written = time.monotonic()
            bar.corrected(len(found.times))
    except KeyboardInterrupt:
        if kept is None or not found.times:
            raise
        write_track(kept, found.track(key, tracker, done=False))
        raise KeyboardInterrupt(
            f"the landmarks of {len(found.times)} frames are in {kept}; the same command resumes"
        ) from None
    if not any(np.isfinite(one).all() for one in found.pixels):
        who = "a person" if options.person is None else f"person {options.person} from the left"
        people = max(tracker.most_people, found.people)
        seen = f"at most {people} at a time" if people else "none in any frame"
        raise CaptureError(path, expected=f"{who} in the video", found=seen)
    track = found.track(key, tracker, done=True)
    if kept is not None:
        write_track(kept, track)
    return track


def _networks(options: PoseOptions) -> tuple[Detector, LandmarkNetwork, str]:
    """Both networks, and the hashes of their files."""
    require_runtime()
    # A worker of a pool has one core for itself.
    threads = 1 if multiprocessing.current_process().daemon else len(os.sched_getaffinity(0))
    first, second = model_files()
    second = options.model or second
    detector = Network(first, input_side=DETECTOR_SIDE, output_sizes={*DETECTOR_OUTPUTS}, threads=threads)
    landmarks = Network(second, input_side=LANDMARK_SIDE, output_sizes={*LANDMARK_OUTPUTS}, threads=threads)
    return Detector(detector), LandmarkNetwork(landmarks), f"{file_hash(first)} {file_hash(second)}"


class _Found:
    """The landmarks so far, as lists that grow by a frame."""

    def __init__(self, before: LandmarkTrack | None) -> None:
        self.times: list[float] = [] if before is None else before.times.tolist()
        self.pixels: list[Array] = [] if before is None else [*before.pixels]
        self.world: list[Array] = [] if before is None else [*before.world]
        self.visibility: list[Array] = [] if before is None else [*before.visibility]
        self.size = (0, 0) if before is None else before.size
        self.people = 0 if before is None else before.people

    def add(self, at: float, landmarks: Landmarks | None, size: tuple[int, int]) -> None:
        self.times.append(at)
        self.size = size
        if landmarks is None:
            self.pixels.append(np.full((COUNT, 2), np.nan))
            self.world.append(np.full((COUNT, 3), np.nan))
            self.visibility.append(np.zeros(COUNT))
        else:
            self.pixels.append(_as_kept(landmarks.pixels))
            self.world.append(_as_kept(landmarks.world))
            self.visibility.append(_as_kept(landmarks.visibility))

    def track(self, key: str, tracker: PersonTracker, *, done: bool) -> LandmarkTrack:
        return LandmarkTrack(
            times=np.array(self.times),
            pixels=np.array(self.pixels),
            world=np.array(self.world),
            visibility=np.array(self.visibility),
            size=self.size,
            key=key,
            done=done,
            followed=tracker.followed,
            people=max(self.people, tracker.most_people),
        )


def _as_kept(values: Array) -> Array:
    """Values as a file of landmarks has them, so that it makes no difference whether one was read."""
    return values.astype(np.float32).astype(np.float64)
