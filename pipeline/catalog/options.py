"""Options shared by the commands on the catalogue."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from kinemimic.pipeline.catalog.local_files import VARIABLE

_Command = TypeVar("_Command", bound=Callable[..., Any])

catalog = click.option(
    "--catalog",
    "catalog_file",
    type=click.Path(path_type=Path),
    help="Your own catalogue (`kinemimic datasets add`) instead of the shipped one.",
)


def folder(name: str) -> Callable[[_Command], _Command]:
    """An option with that name for the folder of recordings, passed to the command as `folder`."""
    return click.option(
        name,
        "folder",
        type=click.Path(path_type=Path, file_okay=False),
        help=f"Folder of the recordings; by default {VARIABLE}, or else the user's cache.",
    )
