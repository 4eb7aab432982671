"""`kinemimic datasets`: the commands on the catalogue."""

from __future__ import annotations

import click

from kinemimic.pipeline.lazy_group import LazyGroup

# As in the command line's own table: named in strings, because some lie in layers above this one.
COMMANDS: dict[str, tuple[str, str]] = {
    "list": ("kinemimic.pipeline.catalog.listing:command", "What the catalogue has, and what of it is here."),
    "fetch": ("kinemimic.pipeline.catalog.fetch:command", "Get recordings, each with the right hash."),
    "verify": ("kinemimic.pipeline.catalog.verify:command", "Compare what is here with the catalogue."),
    "add": ("kinemimic.pipeline.catalog.add:command", "A file into a catalogue of one's own."),
}


@click.group("datasets", cls=LazyGroup, lazy=COMMANDS)
def command() -> None:
    """Public recordings of real sensors: where they are, under which licence, and whether they are whole."""
