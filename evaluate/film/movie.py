"""The film of a rollout as a video file, in real time."""

from __future__ import annotations

from pathlib import Path

from kinemimic.evaluate.film.film import SIZE, Scene, render_frames
from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.files.video import video


def write_movie(
    path: Path,
    scene: Scene,
    *,
    seconds: float,
    camera: str = "follow",
    size: tuple[int, int] = SIZE,
    theme: str = "light",
) -> None:
    """Write the first seconds of a scene, or all of it if it is shorter, as a video of `files/video.py`.

    camera, size, theme: as in `render_frames`. No file is left behind after an error or an interruption.
    """
    frames = min(len(scene.figure.positions), max(1, round(seconds * scene.rate)))
    with video(path, *size, scene.rate) as film, progress("video", frames) as bar:
        for picture in render_frames(scene, range(frames), camera=camera, size=size, theme=theme):
            film.add(picture[..., ::-1])
            bar.advance()
