"""`kinemimic datasets verify`: compare the local recordings with the sizes and hashes of the catalogue."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import click

from kinemimic.pipeline.catalog import options
from kinemimic.pipeline.catalog.entry import Catalog, Entry, collections_of
from kinemimic.pipeline.catalog.load import CATALOG, load_catalog
from kinemimic.pipeline.catalog.local_files import captures_folder
from kinemimic.pipeline.cli.options import json_option
from kinemimic.pipeline.cli.printable import echo
from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import file_hash


@dataclass(frozen=True)
class Verified:
    """Names ("collection/file") by result; wrong: name -> difference; unknown: files in the folder that are
    not in the catalogue."""

    right: tuple[str, ...]
    wrong: dict[str, str]
    missing: tuple[str, ...]
    unknown: tuple[str, ...]


def verify(catalog: Catalog, entries: Sequence[Entry], folder: Path) -> Verified:
    """Compare the files in `folder` with `entries` of the catalogue.

    The collections of `entries` are searched for unknown files, and so is the whole folder if `entries` is
    the whole catalogue.
    """
    if not folder.is_dir():
        raise KinemimicError(
            f"{folder}: expected a folder of recordings, found none; `kinemimic datasets fetch` creates it"
        )
    right: list[str] = []
    wrong: dict[str, str] = {}
    missing: list[str] = []
    with progress("verify", len(entries), unit="files") as bar:
        for entry in entries:
            path = folder / entry.collection / entry.file
            if not path.exists() and not path.is_symlink():
                missing.append(entry.name)
            elif found := _differs(entry, path):
                wrong[entry.name] = found
            else:
                right.append(entry.name)
            bar.advance(1)
    return Verified(tuple(right), wrong, tuple(missing), tuple(_unknown(catalog, entries, folder)))


def _differs(entry: Entry, path: Path) -> str | None:
    if not path.is_file():
        return "expected a file, found none"
    if (size := path.stat().st_size) != entry.bytes:
        return f"expected {entry.bytes:,} bytes, found {size:,}"
    if (found := file_hash(path)) != entry.sha256:
        return f"expected SHA-256 {entry.sha256[:16]}…, found {found[:16]}…"
    return None


def _unknown(catalog: Catalog, entries: Sequence[Entry], folder: Path) -> list[str]:
    known = {entry.name for entry in catalog.entries}
    collections = {collection.name for collection in collections_of(catalog, entries)}
    found = [
        path.relative_to(folder).as_posix()
        for name in sorted(collections)
        if (folder / name).is_dir()
        for path in sorted((folder / name).iterdir())
        if not path.name.startswith(".")  # partial downloads
    ]
    if len(entries) == len(catalog.entries):
        beside = sorted(path for path in folder.iterdir() if path.name not in collections)
        found += [f"{path.name}/" if path.is_dir() else path.name for path in beside]
    return [name for name in found if name not in known]


@click.command("verify")
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option("--all", "everything", is_flag=True, help="Require the whole catalogue.")
@options.folder("--in")
@options.catalog
@json_option("Print the result as JSON.")
@click.pass_context
def command(
    ctx: click.Context,
    names: tuple[str, ...],
    everything: bool,
    folder: Path | None,
    catalog_file: Path | None,
    as_json: bool,
) -> None:
    """Compare the local recordings with the catalogue.

    Exit status 1 if a file differs from the catalogue, or if a file given by name (or, with --all, any
    file) is missing.

    \b
      kinemimic datasets verify
    """
    if names and everything:
        raise click.UsageError("expected names of collections or files, or --all, found both")
    catalog, place = load_catalog(catalog_file or CATALOG), captures_folder(folder)
    entries = catalog.select(names) if names else catalog.entries
    found = verify(catalog, entries, place)
    if as_json:
        click.echo(json.dumps({"folder": str(place), **asdict(found)}, indent=2))
    else:
        for name, what in found.wrong.items():
            echo(f"wrong    {name}: {what}")
        for line in _by_collection(catalog, found.missing):
            echo(f"missing  {line}")
        for name in found.unknown:
            echo(f"unknown  {name}")
        echo(
            f"{place}: {len(found.right)} right, {len(found.wrong)} wrong, {len(found.missing)} missing, "
            f"{len(found.unknown)} unknown to the catalogue"
        )
    if found.wrong or (found.missing and (names or everything)):
        ctx.exit(1)


def _by_collection(catalog: Catalog, missing: Sequence[str]) -> list[str]:
    """Names of the files, or of the collection if all of its files are missing."""
    lines: list[str] = []
    for collection in catalog.collections:
        names = [entry.name for entry in collection.entries if entry.name in missing]
        whole = len(names) == len(collection.entries) > 1
        lines += [f"{collection.name} (all {len(names)} files)"] if whole else names
    return lines
