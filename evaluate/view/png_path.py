"""The type of an option that names a picture to write."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import click

from kinemimic.pipeline.errors import KinemimicError


class PngPath(click.Path):
    """The path of a PNG file; another ending is refused at once, since no other format is written."""

    def __init__(self) -> None:
        super().__init__(path_type=Path, dir_okay=False)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """A Path; KinemimicError for another ending."""
        path = Path(os.fsdecode(super().convert(value, param, ctx)))
        if path.suffix.lower() != ".png":
            raise KinemimicError(f"{path}: expected a picture named .png, found {path.suffix!r}")
        return path
