"""`kinemimic formats`: the capture formats that can be read, and how each is recognised."""

from __future__ import annotations

import json

import click
from rich.table import Table

from kinemimic.pipeline.cli.options import json_option
from kinemimic.pipeline.cli.terminal import show
from kinemimic.pipeline.readers.recognise import formats


@click.command()
@json_option("Print the list as JSON.")
def command(as_json: bool) -> None:
    """List the capture formats that can be read.

    A file is recognised by its content, not by its name. It may be compressed with gzip.

    \b
      kinemimic formats
      kinemimic formats --json
    """
    if as_json:
        keys = ("name", "sensor", "holds", "recognised_by", "sidecar_file", "binary")
        records = [{key: getattr(one, key) for key in keys} for one in formats()]
        click.echo(json.dumps(records, indent=2))
        return
    table = Table(box=None, pad_edge=False, padding=(0, 2, 1, 0), header_style="bold")
    for heading, ratio in (
        ("format", 4),
        ("sensor", 4),
        ("holds", 6),
        ("recognised by", 6),
        ("sidecar file", 3),
    ):
        table.add_column(heading, ratio=ratio, overflow="fold")
    for one in sorted(formats(), key=lambda one: one.name.lower()):
        table.add_row(one.name, one.sensor, one.holds, one.recognised_by, one.sidecar_file or "-")
    show(table)
