"""A clip in a run folder as `ingest` and `convert` leave it."""

from __future__ import annotations

from pathlib import Path

from kinemimic.pipeline.convert import convert
from kinemimic.pipeline.files.store import write_clip
from kinemimic.pipeline.kinematics.clip import Clip


def write_converted(run: Path, clip: Clip) -> None:
    write_clip(run / "clip.parquet", clip)
    convert(run)
