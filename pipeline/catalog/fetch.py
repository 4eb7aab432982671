"""`kinemimic datasets fetch`: fetch recordings into a folder and check their hashes."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

import click
import pooch
import requests

from kinemimic.pipeline.catalog import options
from kinemimic.pipeline.catalog.download import Download, RetryPolicy, UnreachableError, without_credentials
from kinemimic.pipeline.catalog.entry import HOST, Entry, collections_of
from kinemimic.pipeline.catalog.load import CATALOG, load_catalog
from kinemimic.pipeline.catalog.local_files import captures_folder, target_path
from kinemimic.pipeline.cli.main import BAD_INPUT
from kinemimic.pipeline.cli.options import json_option
from kinemimic.pipeline.cli.printable import echo
from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import file_hash

_CHUNK = 2**20


@dataclass(frozen=True)
class Fetched:
    """paths: the files that are present, with the right hash; failures: a message per missing file;
    replaced: those of the paths that replaced a file with other content."""

    paths: tuple[Path, ...]
    failures: tuple[str, ...]
    replaced: tuple[Path, ...]


def fetch(
    entries: Sequence[Entry],
    folder: Path,
    *,
    mirror: str | Path | None = None,
    retry_policy: RetryPolicy | None = None,
) -> Fetched:
    """Fetch files to `folder`/COLLECTION/FILE; files that are present with the right hash are kept.

    mirror: a folder with COLLECTION/FILE, or the base URL that replaces GitHub's host of raw files.
    A failure is reported in the result and does not stop other files, unless the host is unreachable.
    OSError if the folder cannot be written. A call after Ctrl-C resumes.
    """
    source = _source(mirror)
    wanted: list[tuple[Entry, Path]] = []
    present: dict[str, Path] = {}
    failures: list[str] = []
    different: set[Path] = set()
    for entry in entries:
        try:
            path = target_path(entry, folder)
        except KinemimicError as error:
            failures.append(str(error))
            continue
        if path.is_file() and path.stat().st_size == entry.bytes and file_hash(path) == entry.sha256:
            present[entry.name] = path
        else:
            wanted.append((entry, path))
            if path.is_file():
                different.add(path)
    pooch.get_logger().setLevel(logging.WARNING)  # it would log every URL
    with (
        requests.Session() as session,
        progress("fetch", sum(entry.bytes for entry, _ in wanted), unit="bytes") as bar,
    ):
        session.max_redirects = 5
        for done, (entry, path) in enumerate(wanted):
            bar.advance(0, of=entry.collection)
            try:
                if isinstance(source, Path):
                    _retrieve(
                        entry, path, str(source / entry.collection / entry.file), _Copy(entry, bar.advance)
                    )
                else:
                    download = Download(entry, path, session, retry_policy or RetryPolicy(), bar.advance)
                    _retrieve(entry, path, entry.url_at(source), download)
                present[entry.name] = path
            except KinemimicError as error:
                failures.append(without_credentials(str(error)))
                if isinstance(error, UnreachableError) and (left := len(wanted) - done - 1):
                    failures.append(f"{left} more files were not tried, for the same reason")
                    break
            except KeyboardInterrupt:
                raise KeyboardInterrupt(
                    f"{len(present)} of {len(entries)} files are in {folder}; the same command resumes"
                ) from None
    paths = tuple(present[entry.name] for entry in entries if entry.name in present)
    return Fetched(paths, tuple(failures), tuple(path for path in paths if path in different))


def _source(mirror: str | Path | None) -> str | Path:
    """The folder, or the base of all URLs."""
    if mirror is None:
        return HOST
    shown = without_credentials(str(mirror))
    if isinstance(mirror, str) and "://" in mirror:
        if not _is_web_address(mirror):
            raise KinemimicError(f"expected the folder or http(s) URL of a mirror, found {shown!r}")
        return mirror
    if not Path(mirror).is_dir():
        raise KinemimicError(f"{shown}: expected the folder of a mirror, found none")
    return Path(mirror)


def _is_web_address(text: str) -> bool:
    try:
        parts = urlsplit(text)
        return parts.scheme in ("http", "https") and bool(parts.hostname) and parts.port != 0
    except ValueError:  # no number as the port, or an unclosed bracket
        return False


class _Copy:
    """A downloader for pooch that copies from a folder, at most as many bytes as the catalogue states."""

    def __init__(self, entry: Entry, advance: Callable[[int], object]) -> None:
        self.entry, self.advance = entry, advance

    def __call__(self, url: str, output_file: str, pooch: object) -> None:
        try:
            size = Path(url).stat().st_size if Path(url).is_file() else None
        except OSError:
            size = None
        if size != self.entry.bytes:
            found = "no file" if size is None else f"{size:,}"
            raise KinemimicError(
                f"{self.entry.name}: expected {self.entry.bytes:,} bytes at {url}, found {found}"
            )
        with Path(url).open("rb") as taken, Path(output_file).open("wb") as given:
            left = self.entry.bytes
            while left and (chunk := taken.read(min(_CHUNK, left))):
                given.write(chunk)
                left -= len(chunk)
                self.advance(len(chunk))


def _retrieve(entry: Entry, path: Path, url: str, downloader: Download | _Copy) -> None:
    """Download through pooch, which checks the hash before it moves the file to `path`."""
    try:
        pooch.retrieve(
            url, known_hash=f"sha256:{entry.sha256}", fname=path.name, path=path.parent, downloader=downloader
        )
    except ValueError as error:
        if "hash" not in str(error):
            raise
        raise KinemimicError(
            f"{entry.name}: expected the file with SHA-256 {entry.sha256[:16]}…, "
            f"found a different file of the same size at {url}; it was discarded"
        ) from None


@click.command("fetch")
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option("--all", "everything", is_flag=True, help="Fetch the whole catalogue.")
@options.folder("--into")
@click.option(
    "--mirror",
    metavar="FOLDER|URL",
    help=f"A folder with COLLECTION/FILE, or a base URL in place of {HOST}.",
)
@options.catalog
@json_option("Print the result as JSON.")
@click.pass_context
def command(
    ctx: click.Context,
    names: tuple[str, ...],
    everything: bool,
    folder: Path | None,
    mirror: str | None,
    catalog_file: Path | None,
    as_json: bool,
) -> None:
    """Fetch recordings by the names of collections or files ("kinect1_*", cmu_bvh/02_01.bvh, r2.skl).

    Files that are already present with the correct hash are not fetched again; interrupted downloads are
    resumed. Prints the paths, one per line.

    \b
      kinemimic datasets fetch kinect1_bernstein_skl/r2.skl
    """
    if bool(names) == everything:
        raise click.UsageError(
            "expected names of collections or files (see `kinemimic datasets list`), or --all"
        )
    catalog = load_catalog(catalog_file or CATALOG)
    entries = catalog.entries if everything else catalog.select(names)
    for collection in collections_of(catalog, entries):
        echo(f"{collection.name}: licence: {collection.licence}; from: {collection.citation}", err=True)
    fetched = fetch(entries, captures_folder(folder), mirror=mirror)
    if as_json:
        record = {
            "paths": [str(path) for path in fetched.paths],
            "failures": fetched.failures,
            "replaced": [str(path) for path in fetched.replaced],
        }
        click.echo(json.dumps(record, indent=2))
    else:
        for path in fetched.paths:
            echo(str(path))
    for path in fetched.replaced:
        echo(f"{path}: replaced a file with other content", err=True)
    for failure in fetched.failures:
        echo(f"kinemimic: {failure}", err=True)
    if fetched.failures:
        ctx.exit(BAD_INPUT)
