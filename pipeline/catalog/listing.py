"""`kinemimic datasets list`: the recordings of the catalogue, and which of them are present locally."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from kinemimic.pipeline.catalog import options
from kinemimic.pipeline.catalog.entry import Collection, Entry, collections_of
from kinemimic.pipeline.catalog.load import CATALOG, load_catalog
from kinemimic.pipeline.catalog.local_files import captures_folder, is_present
from kinemimic.pipeline.cli.options import json_option
from kinemimic.pipeline.cli.printable import echo
from kinemimic.pipeline.cli.terminal import grid, key_value_table, show

_MIN_WIDTH = 12  # characters of a column that wraps


@click.command("list")
@click.argument("patterns", nargs=-1, metavar="[PATTERN]...")
@options.folder("--in")
@options.catalog
@json_option("Print the list as JSON.")
def command(patterns: tuple[str, ...], folder: Path | None, catalog_file: Path | None, as_json: bool) -> None:
    """List the recordings of the catalogue, or those that match names or patterns ("kinect2_*", r2.skl).

    For a single collection: its files, citation and URL.

    \b
      kinemimic datasets list kinect1_bernstein_skl
    """
    catalog, place = load_catalog(catalog_file or CATALOG), captures_folder(folder)
    entries = catalog.select(patterns) if patterns else catalog.entries
    collections = collections_of(catalog, entries)
    wanted = set(entries)
    chosen = [(one, [entry for entry in one.entries if entry in wanted]) for one in collections]
    if as_json:
        records = [_record(one, own, place) for one, own in chosen]
        click.echo(json.dumps(records, indent=2))
    elif patterns and len(chosen) == 1:
        _show_one(*chosen[0], place)
    else:
        _show_all(chosen, place)


def _record(collection: Collection, entries: Sequence[Entry], place: Path) -> dict[str, Any]:
    record = {key: value for key, value in asdict(collection).items() if key != "entries"}
    files = [
        {
            "name": entry.file,
            **{key: getattr(entry, key) for key in ("bytes", "sha256", "url", "format", "frame_rate")},
            "here": is_present(entry, place),
        }
        for entry in entries
    ]
    return {**record, "files": files}


def _show_all(chosen: Sequence[tuple[Collection, Sequence[Entry]]], place: Path) -> None:
    table = grid()
    for heading in ("collection", "sensor", "format"):
        table.add_column(heading, overflow="fold", no_wrap=heading == "collection", min_width=_MIN_WIDTH)
    for heading in ("files", "MB", "Hz", "here"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("licence", overflow="fold", min_width=_MIN_WIDTH)
    for collection, entries in chosen:
        here = sum(is_present(entry, place) for entry in entries)
        table.add_row(
            collection.name,
            collection.sensor,
            ", ".join(dict.fromkeys(entry.format for entry in entries if entry.format)) or "-",
            f"{len(entries)}",
            f"{sum(entry.bytes for entry in entries) / 1e6:.1f}",
            _rates(entries),
            "all" if here == len(entries) else f"{here}" if here else "-",
            _first_clause(collection.licence),
        )
    entries = [entry for _, own in chosen for entry in own]
    here = sum(is_present(entry, place) for entry in entries)
    show(table)
    # Without rich, which would wrap the path.
    echo(
        f"\n{len(chosen)} collections, {len(entries)} files, {_size(sum(e.bytes for e in entries))}; "
        f"{here} of the files in {place}"
    )


def _show_one(collection: Collection, entries: Sequence[Entry], place: Path) -> None:
    summary = key_value_table()
    for what in ("title", "sensor", "shows", "licence", "citation"):
        summary.add_row(what, getattr(collection, what))
    table = grid("file", "format", "size", "Hz", "here", left=2)
    for entry in entries:
        row = (entry.format or "-", _size(entry.bytes), _rates([entry]))
        table.add_row(entry.file, *row, "yes" if is_present(entry, place) else "-")
    show(f"{collection.name}\n", summary)
    echo(f"URL       https://github.com/{collection.repository}/tree/{collection.commit}\n")
    show(table)
    if len(entries) == 1:
        echo(f"\n{entries[0].url}\nSHA-256 {entries[0].sha256}")


def _first_clause(text: str) -> str:
    """The first clause; the listing of a single collection shows the full text."""
    first, _, rest = text.partition(";")
    return f"{first} …" if rest else first


def _rates(entries: Iterable[Entry]) -> str:
    """Frame rates in Hz: up to two values, or the range."""
    rates = sorted({entry.frame_rate for entry in entries if entry.frame_rate is not None})
    if len(rates) > 2:
        return f"{rates[0]:.3g}–{rates[-1]:.3g}"
    return ", ".join(f"{rate:.4g}" for rate in rates) or "-"


def _size(count: int) -> str:
    return (
        f"{count / 1e6:.1f} MB" if count >= 1e6 else f"{count / 1e3:.1f} kB" if count >= 1e3 else f"{count} B"
    )
