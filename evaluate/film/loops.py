"""Pictures for pages: a filmstrip, and a short loop as animated WebP."""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence

import numpy as np
from PIL import Image

from kinemimic.evaluate.film.film import Scene, render_frames
from kinemimic.evaluate.film.render import Picture


def filmstrip(
    scene: Scene,
    frames: Sequence[int],
    *,
    camera: str = "side",
    size: tuple[int, int] = (190, 260),
    theme: str = "light",
) -> Picture:
    """The given frames side by side in one picture, without words. size: of each frame, pixels."""
    return np.hstack(list(render_frames(scene, frames, camera=camera, size=size, theme=theme, labels=False)))


def loop_webp(pictures: Iterable[Picture], rate: float, *, quality: int = 70) -> bytes:
    """Pictures of one size as an endless animated WebP at `rate` pictures a second, without a time stamp.

    quality: 0 to 100. ValueError if there are no pictures.
    """
    images = [Image.fromarray(picture) for picture in pictures]
    if not images:
        raise ValueError("a loop needs at least one picture")
    stream = io.BytesIO()
    # Each frame lasts a whole number of milliseconds; the rounding must not add up.
    ends = np.round(np.arange(1, len(images) + 1) * 1000 / rate)
    durations = np.diff(ends, prepend=0).astype(int).tolist()
    images[0].save(
        stream, "WEBP", save_all=True, append_images=images[1:], duration=durations, loop=0,
        quality=quality, method=4, minimize_size=False,
    )  # fmt: skip
    return stream.getvalue()
