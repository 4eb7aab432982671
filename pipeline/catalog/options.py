"""The options that the commands on the catalogue share."""

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
    help="A catalogue of one's own (`kinemimic datasets add`) in place of ours.",
)


def folder(name: str) -> Callable[[_Command], _Command]:
    """Where recordings lie, under the name that suits the command; its parameter is `folder`."""
    return click.option(
        name,
        "folder",
        type=click.Path(path_type=Path, file_okay=False),
        help=f"Folder of the recordings; else what {VARIABLE} says, else the user's cache.",
    )
