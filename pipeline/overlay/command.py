"""`kinemimic overlay`: draw the skeleton into the images of a video or a depth recording, as a video."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import click
import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.cli.options import RunFolder, json_option
from kinemimic.pipeline.cli.printable import echo
from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.errors import CaptureError, KinemimicError
from kinemimic.pipeline.files.store import read_clip
from kinemimic.pipeline.files.video import video
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.overlay.draw import draw_caption, draw_skeleton, shaded
from kinemimic.pipeline.overlay.video_overlay import draw_on_video
from kinemimic.pipeline.readers.depth.camera import Camera
from kinemimic.pipeline.readers.depth.folder import (
    COLOR_FOLDER,
    COLOR_SUFFIXES,
    is_recording,
    numbered_images,
)
from kinemimic.pipeline.readers.depth.frames import Image, load, read_color, read_depth
from kinemimic.pipeline.readers.depth.recording import Recording, open_recording, read_recording
from kinemimic.pipeline.readers.recognise import read
from kinemimic.pipeline.readers.video.container import is_video

VIEWS: tuple[str, ...] = ("depth", "color")
OVERLAY = "overlay.webm"
# Metres in front of and behind the person that the grey levels of depth cover.
_DEPTH_MARGIN = 1.0
# Seconds; Unix times in double precision are more exact.
_TIME_TOLERANCE = 1e-5


@dataclass(frozen=True)
class Overlay:
    """Path of the video, view, number of frames, and number of joints drawn in all of them together."""

    path: Path
    view: str
    frames: int
    joints: int


def overlay(folder: Path, out: Path, *, run: Path | None = None, view: str | None = None) -> Overlay:
    """Draw the 20 nodes of a recording, or of the run made from it (its clip.parquet), into a video.

    view: "depth" or "color"; by default "color" if there are colour images. The video has one image per depth
    frame, at the median frame rate. folder: may also be a video, whose frames then have the fitted skeleton.
    KinemimicError for a folder that is not a recording, a run of another capture, or missing colour images.
    """
    if is_video(folder):
        if view is not None:
            raise CaptureError(folder, expected="no choice of images for a video", found=f"{view!r}")
        clip = read(folder) if run is None else _clip_of_run(run, folder)
        return Overlay(out, "video", *draw_on_video(folder, clip, out))
    if not is_recording(folder):
        raise CaptureError(
            folder, expected="a video, or a depth recording (a folder with a camera.toml)", found="neither"
        )
    recording = open_recording(folder)
    colours = numbered_images(folder / COLOR_FOLDER, COLOR_SUFFIXES)
    view = view or ("color" if colours else "depth")
    if view not in VIEWS or (view == "color" and not colours):
        found = "no colour images" if view in VIEWS else repr(view)
        raise CaptureError(folder, expected=f"a view among {', '.join(VIEWS)}", found=found)
    clip = read_recording(folder) if run is None else _clip_of_run(run, folder)
    pixels, states = _nodes_in_view(recording, clip, view)
    if not states.any():
        raise CaptureError(folder, expected="joints on valid depth", found="none in any frame")
    camera = _camera(recording, view)
    pictures = _depths(recording, clip) if view == "depth" else _colours(recording, colours)
    rate = 1.0 / float(np.median(np.diff(recording.times))) if len(recording.times) > 1 else 1.0
    with (
        video(out, camera.width, camera.height, rate) as film,
        progress("overlay", len(recording.frames), unit="frames") as bar,
    ):
        for row, picture in enumerate(pictures):
            caption = f"frame {recording.frames[row]}   {recording.times[row] - recording.times[0]:.3f} s"
            draw_skeleton(picture, pixels[row], states[row])
            draw_caption(picture, caption, states[row])
            film.add(picture)
            bar.advance()
    drawn = int((np.isfinite(pixels).all(axis=-1) & camera.inside(pixels)).sum())
    return Overlay(out, view, len(recording.frames), drawn)


def _clip_of_run(run: Path, folder: Path) -> Clip:
    clip = read_clip(run / "clip.parquet")
    name, source = folder.name or folder.resolve().name, clip.provenance.get("source")
    if source != name:
        raise KinemimicError(f"{run}: expected a run of {name}, found one of {source}; ingest {name} into it")
    return clip


def _camera(recording: Recording, view: str) -> Camera:
    color = recording.setup.color
    return color.camera if view == "color" and color is not None else recording.setup.camera


def _nodes_in_view(recording: Recording, clip: Clip, view: str) -> tuple[Array, NDArray[np.uint8]]:
    """Pixels (T, 20, 2) and states (T, 20) of the nodes in every frame of the recording.

    Nodes are missing in frames that the clip lacks.
    """
    positions, states = to_nodes(clip)
    row = np.searchsorted(clip.times, recording.times - _TIME_TOLERANCE)
    row = np.minimum(row, len(clip.times) - 1)
    present = np.abs(clip.times[row] - recording.times) <= _TIME_TOLERANCE
    points = recording.setup.mount.to_camera(positions[row])
    color = recording.setup.color
    if view == "color" and color is not None:
        points = color.from_depth(points)
    pixels = _camera(recording, view).project(points)
    pixels[~present] = np.nan
    seen = np.isfinite(pixels).all(axis=-1)
    return pixels, np.where(seen, states[row], 0).astype(np.uint8)


def _depths(recording: Recording, clip: Clip) -> Iterator[Image]:
    """Every depth image as grey levels around the person, for contrast in a deep room."""
    setup = recording.setup
    depth = setup.mount.to_camera(clip.positions)[..., 2]
    seen = np.isfinite(depth).any(axis=1)
    # Interpolated over frames without a subject.
    centre = np.interp(recording.times, clip.times[seen], [np.nanmedian(row) for row in depth[seen]])
    for path, person in zip(recording.images, centre.tolist(), strict=True):
        image = read_depth(path, load(path, setup.camera, 2), setup.camera, setup.units)
        yield shaded(image, person - _DEPTH_MARGIN, person + _DEPTH_MARGIN)


def _colours(recording: Recording, colours: dict[int, Path]) -> Iterator[Image]:
    """The colour image of every depth frame, black if it has none."""
    camera = _camera(recording, "color")
    for frame in recording.frames:
        path = colours.get(frame)
        black: Image = np.zeros((camera.height, camera.width, 3), dtype=np.uint8)
        yield black if path is None else read_color(path, camera)


@click.command()
@click.argument("recording", type=click.Path(path_type=Path))
@click.option(
    "--run",
    type=RunFolder(),
    help="Draw the clip of this run instead of the joints as recorded.",
)
@click.option(
    "--on", "view", type=click.Choice(VIEWS), help="Images to draw on; by default colour if available."
)
@click.option(
    "--out", type=click.Path(path_type=Path, dir_okay=False),
    help=f"A .webm file, or .mp4 with an H.264 encoder; by default {OVERLAY}, in RUN if there is one.",
)  # fmt: skip
@json_option("Print the result as JSON.")
def command(recording: Path, run: Path | None, view: str | None, out: Path | None, as_json: bool) -> None:
    """Draw the 20 nodes of RECORDING into its images: a video, or the folder of a depth recording.

    \b
      kinemimic overlay walk.mp4 --run runs/walk
      kinemimic overlay recording
      kinemimic overlay recording --run runs/recording --on depth --out depth.webm
    """
    drawn = overlay(recording, out or (run or Path()) / OVERLAY, run=run, view=view)
    if as_json:
        click.echo(json.dumps({**asdict(drawn), "path": drawn.path.as_posix()}))
    else:
        echo(f"{drawn.path}: {drawn.frames} frames, {drawn.joints} joints drawn on {drawn.view}")
