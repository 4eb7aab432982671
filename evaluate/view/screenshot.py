"""A picture of a rerun recording, made without a screen."""

from __future__ import annotations

from pathlib import Path

from kinemimic.evaluate.view.headless import drawing
from kinemimic.pipeline.files.store import atomic

SIZE = (1600, 1000)


def screenshot(recording: Path, picture: Path, *, timeline: str, seconds: float) -> None:
    """Draw a recording at a time of its timeline as PNG; needs what `headless.drawing` does."""
    with drawing(recording, timeline=timeline, size=SIZE, last=seconds) as draw, atomic(picture) as temporary:
        temporary.write_bytes(draw(seconds))
