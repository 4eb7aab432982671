"""Films of several rollouts as one: a panel for each, in rows."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from kinemimic.evaluate.film.film import Scene, render_frames
from kinemimic.evaluate.film.render import Picture

PANEL = (480, 360)  # pixels


def render_tiles(
    scenes: Sequence[tuple[str, Scene]],
    frames: Iterable[int],
    *,
    columns: int,
    size: tuple[int, int] = PANEL,
) -> Iterator[Picture]:
    """Pictures of frames from the side: a panel of `size` pixels for each (name, scene), `columns` in a row.

    A scene that is shorter stays at its last frame. ValueError without a scene, and as `render_frames`.
    """
    if not scenes:
        raise ValueError("no scenes")
    wanted = list(frames)
    films = [
        render_frames(
            replace(scene, note=f"{name}, {scene.note}" if scene.note else name),
            [min(frame, len(scene.figure.positions) - 1) for frame in wanted],
            camera="side",
            size=size,
        )
        for name, scene in scenes
    ]
    rows = -(-len(films) // columns)
    width, height = size
    for panels in zip(*films, strict=True):
        sheet = np.full((rows * height, columns * width, 3), 255, dtype=np.uint8)
        for k, panel in enumerate(panels):
            row, column = divmod(k, columns)
            sheet[row * height : (row + 1) * height, column * width : (column + 1) * width] = panel
        yield sheet
