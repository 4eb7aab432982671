"""Pictures for pages: a filmstrip, and a short loop as animated WebP."""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence

import numpy as np
from PIL import Image

from kinemimic.evaluate.film.film import Scene, render_frames
from kinemimic.evaluate.film.render import Picture

_QUALITY = 70  # of WebP, 0 to 100


def filmstrip(scene: Scene, frames: Sequence[int], *, size: tuple[int, int]) -> Picture:
    """Frames next to each other in one picture, from the side, without words. size: of each frame, pixels."""
    return np.hstack(list(render_frames(scene, frames, camera="side", size=size, labels=False)))


def loop_webp(pictures: Iterable[Picture], rate: float) -> bytes:
    """Pictures of one size as an endless animated WebP at `rate` pictures a second, without a time stamp.

    ValueError if there are no pictures.
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
        quality=_QUALITY, method=4, minimize_size=False,
    )  # fmt: skip
    return stream.getvalue()
