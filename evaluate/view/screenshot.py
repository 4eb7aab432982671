"""Screenshot of a rerun recording, rendered without a screen."""

from __future__ import annotations

from pathlib import Path

from kinemimic.evaluate.view.headless import headless_viewer
from kinemimic.pipeline.files.store import atomic

SIZE = (1600, 1000)


def screenshot(recording: Path, picture: Path, *, timeline: str, seconds: float) -> None:
    """Render a recording at a time of its timeline as PNG; requirements: see `headless_viewer`."""
    with (
        headless_viewer(recording, timeline=timeline, size=SIZE, latest=seconds) as draw,
        atomic(picture) as temporary,
    ):
        temporary.write_bytes(draw(seconds))
