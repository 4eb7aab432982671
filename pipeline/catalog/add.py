"""`kinemimic datasets add`: add a local file to your own catalogue, with its size, hash, format and rate."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

import click
import numpy as np

from kinemimic.pipeline.catalog.entry import Catalog, Collection, Entry
from kinemimic.pipeline.catalog.load import NONE, SCHEMA, parse_catalog
from kinemimic.pipeline.cli.options import json_option
from kinemimic.pipeline.cli.printable import echo
from kinemimic.pipeline.errors import CaptureError, KinemimicError
from kinemimic.pipeline.files.store import atomic, file_hash
from kinemimic.pipeline.files.toml_text import quoted
from kinemimic.pipeline.readers.recognise import open_capture, reader_of
from kinemimic.pipeline.readers.video.container import FORMAT as VIDEO
from kinemimic.pipeline.readers.video.container import is_video

_UNKNOWN = "not stated"


def add(
    file: Path,
    catalog: Path,
    collection: str,
    *,
    path: str,
    name: str | None = None,
    repository: str | None = None,
    commit: str | None = None,
    licence: str | None = None,
    citation: str | None = None,
    title: str | None = None,
    sensor: str | None = None,
    shows: str | None = None,
) -> tuple[Entry, str | None]:
    """Add a file to a catalogue, which is created if it does not exist; existing entries stay unchanged.

    path: path of the file in its repository; name: name of the file in the collection, by default its own.
    A new collection needs repository, commit, licence and citation. A file of an existing collection may
    have another repository and commit. Returns the entry, and a note if the format or rate is unknown.

    KinemimicError if the file or its name is in the catalogue already, or if a value is missing.
    """
    if not file.is_file():
        raise KinemimicError(f"{file}: expected a file, found {'a folder' if file.is_dir() else 'none'}")
    text, known = _existing(catalog)
    size, sha256, name = file.stat().st_size, file_hash(file), name or file.name
    _require_new(known, f"{collection}/{name}", file, sha256)
    given = {
        "repository": repository,
        "commit": commit,
        "licence": licence,
        "citation": citation,
        "title": title,
        "sensor": sensor,
        "shows": shows,
    }
    format, recorder, rate, note = _recognised(file)
    existing = next((one for one in known.collections if one.name == collection), None)
    line: dict[str, str | int | float] = {"name": name, "path": path, "bytes": size, "sha256": sha256}
    if existing is None:
        texts = {"title": collection, "sensor": recorder, "shows": _UNKNOWN}
        texts |= {key: text for key, text in given.items() if text}
        if rate is not None:
            line["frame_rate"] = rate
        new_text = text + _new_collection(catalog, collection, format, texts, line)
    else:
        line |= _overrides(catalog, existing, format, rate, given)
        new_text = _with_line(catalog, text, known, existing, line)
    parsed = parse_catalog(catalog, new_text)
    added = [entry for entry in parsed.entries if entry not in known.entries]
    if len(added) != 1 or len(parsed.entries) != len(known.entries) + 1:
        raise _unsupported_layout(catalog)
    with atomic(catalog) as temporary:
        temporary.write_bytes(new_text.encode())
    return added[0], note


def _existing(catalog: Path) -> tuple[str, Catalog]:
    try:
        text = catalog.read_bytes().decode()
    except FileNotFoundError:
        return f"schema = {SCHEMA}\n", Catalog(catalog, ())
    except UnicodeDecodeError as error:
        raise KinemimicError(f"{catalog}: expected text in UTF-8, found {error.reason}") from None
    return text if text.endswith("\n") else f"{text}\n", parse_catalog(catalog, text)


def _require_new(known: Catalog, name: str, file: Path, sha256: str) -> None:
    """KinemimicError if a catalogue has an entry of this name, COLLECTION/FILE, or with this content."""
    for entry in known.entries:
        if entry.name == name:
            raise KinemimicError(
                f"{known.path}: expected a new name, found {name} already in it; choose a name with --as"
            )
        if entry.sha256 == sha256:
            raise KinemimicError(
                f"{known.path}: expected a new file, found {file} already in it, as {entry.name}"
            )


def _recognised(file: Path) -> tuple[str | None, str, float | None, str | None]:
    """Format, sensor, frame rate (Hz), and a note if one of them is unknown."""
    if is_video(file):
        from kinemimic.pipeline.video.decode import frame_times  # noqa: PLC0415 (loads OpenCV)

        try:
            steps = np.diff(frame_times(file))
        except CaptureError as error:
            return VIDEO.name, VIDEO.sensor, None, f"unknown frame rate: {error}"
        rate = round(1.0 / float(np.median(steps)), 2) if len(steps) else None
        return VIDEO.name, VIDEO.sensor, rate, None if rate else "unknown frame rate: one frame"
    try:
        source = open_capture(file)
        reader = reader_of(source)
    except CaptureError as error:
        return None, _UNKNOWN, None, f"unknown format: {error}"
    known = reader.FORMAT
    try:
        return known.name, known.sensor, round(reader.read(source).rate, 2) or None, None
    except CaptureError as error:
        return known.name, known.sensor, None, f"unknown frame rate: {error}"


def _overrides(
    catalog: Path,
    collection: Collection,
    format: str | None,
    rate: float | None,
    given: Mapping[str, str | None],
) -> dict[str, str | int | float]:
    """The values of a file that differ from those of its collection."""
    overrides: dict[str, str | int | float] = {}
    for key in ("licence", "citation", "title", "sensor", "shows"):
        if given.get(key) not in (None, current := getattr(collection, key)):
            raise KinemimicError(
                f"{catalog}: expected --{key} {current!r}, as in {collection.name}, found {given[key]!r}; "
                "use another --collection"
            )
    origin = (given.get("repository") or collection.repository, given.get("commit") or collection.commit)
    if origin != (collection.repository, collection.commit):
        overrides |= {"repository": origin[0], "commit": origin[1]}
    if format != collection.format:
        overrides["format"] = format or NONE
    if format and rate != collection.frame_rate:
        overrides["frame_rate"] = rate or 0
    return overrides


def _new_collection(
    catalog: Path,
    name: str,
    format: str | None,
    given: Mapping[str, str],
    line: dict[str, str | int | float],
) -> str:
    for key in ("repository", "commit", "licence", "citation"):
        if key not in given:
            raise KinemimicError(f"{catalog}: expected --{key} for the new collection {name!r}, found none")
    keys = (
        {"name": name}
        | {key: given[key] for key in ("title", "sensor", "shows")}
        | {"format": format or NONE}
    )
    keys |= {key: given[key] for key in ("licence", "citation", "repository", "commit")}
    head = "".join(f"{key} = {quoted(value)}\n" for key, value in keys.items())
    return f"\n[[collection]]\n{head}files = [\n{_inline(line)}]\n"


def _with_line(
    catalog: Path, text: str, known: Catalog, collection: Collection, line: dict[str, str | int | float]
) -> str:
    """The text with one more file in a collection, inserted after the bracket that opens its list.

    The caller parses the result again before writing it.
    """
    heads = [found.start() for found in re.finditer(r"^[ \t]*\[\[\s*collection\s*\]\]", text, re.MULTILINE)]
    number = known.collections.index(collection)
    if len(heads) != len(known.collections):
        raise _unsupported_layout(catalog)
    opened = re.compile(r"^[ \t]*files[ \t]*=[ \t]*\[[ \t]*\n?", re.MULTILINE).search(text, heads[number])
    if opened is None:
        raise _unsupported_layout(catalog)
    before = text[: opened.end()]
    return (before if before.endswith("\n") else f"{before}\n") + _inline(line) + text[opened.end() :]


def _inline(line: dict[str, str | int | float]) -> str:
    pairs = (f"{key} = {quoted(value) if isinstance(value, str) else value}" for key, value in line.items())
    return f"  {{ {', '.join(pairs)} }},\n"


def _unsupported_layout(catalog: Path) -> KinemimicError:
    return KinemimicError(
        f"{catalog}: expected [[collection]] and files = [ at the start of lines, found another TOML layout; "
        "add the entry by hand"
    )


@click.command("add")
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--catalog",
    type=click.Path(path_type=Path),
    required=True,
    help="Your catalogue; created if it does not exist.",
)
@click.option("--collection", required=True, metavar="NAME", help="Folder into which the file is fetched.")
@click.option("--as", "name", metavar="NAME", help="Name of the file there; by default its own name.")
@click.option("--path", required=True, help="Path of the file in its repository.")
@click.option("--repository", metavar="OWNER/NAME", help="GitHub repository of the file.")
@click.option("--commit", metavar="SHA", help="Commit of the repository, 40 hexadecimal digits.")
@click.option("--licence", help='Licence as stated in the repository, or "none stated".')
@click.option("--citation", help="Publication or author to cite.")
@click.option("--title", help="Short title of the collection.")
@click.option("--sensor", help="Sensor; by default the one of the file's format.")
@click.option("--shows", help="Description of the motion, and caveats.")
@json_option("Print the entry as JSON.")
def command(file: Path, catalog: Path, collection: str, as_json: bool, **given: str | None) -> None:
    """Add a local FILE to your own catalogue, with its size, SHA-256, format and frame rate.

    A new collection needs --repository, --commit, --licence and --citation.

    \b
      kinemimic datasets add walk.skl --catalog mine.toml --collection home --path data/walk.skl \\
        --repository me/walks --commit 0123456789abcdef0123456789abcdef01234567 \\
        --licence CC0-1.0 --citation "Me, 2026"
    """
    path, name = given.pop("path") or "", given.pop("name")
    entry, note = add(file, catalog, collection, path=path, name=name, **given)
    if as_json:
        record = {**asdict(entry), "url": entry.url, "note": note}
        click.echo(json.dumps(record, indent=2))
        return
    if note:
        echo(note, err=True)
    rate = "" if entry.frame_rate is None else f", {entry.frame_rate:.4g} Hz"
    echo(f"{catalog}: {entry.name}: {entry.format or 'unknown format'}{rate}, {entry.bytes:,} bytes")
    echo(entry.url)
