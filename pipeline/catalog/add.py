"""`kinemimic datasets add`: a file into a catalogue of one's own, measured and recognised by our readers."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

import click

from kinemimic.pipeline.catalog.entry import Catalog, Collection, Entry
from kinemimic.pipeline.catalog.load import NONE, SCHEMA, parse_catalog
from kinemimic.pipeline.cli.options import json_option
from kinemimic.pipeline.errors import CaptureError, KinemimicError
from kinemimic.pipeline.files.store import atomic, file_hash
from kinemimic.pipeline.files.toml_text import quoted
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.recognise import reader_of

_UNTOLD = "not stated"


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
    """Write a file's entry into a catalogue, which is made if there is none; what it holds stays as it is.

    path: of the file in its repository; name: of the file in the collection, by default its own. A new
    collection needs repository, commit, licence and citation; one that is there has them, and a file of it
    may have another repository and commit. Returns the entry, and why no format or frame rate is known.

    A KinemimicError if the file or its name is in the catalogue already, or if something is missing.
    """
    if not file.is_file():
        raise KinemimicError(f"{file}: expected a file, found {'a folder' if file.is_dir() else 'none'}")
    text, known = _there(catalog)
    size, sha256, name = file.stat().st_size, file_hash(file), name or file.name
    for entry in known.entries:
        if entry.name == f"{collection}/{name}":
            raise KinemimicError(
                f"{catalog}: expected a new name, found {entry.name} there already; name it --as"
            )
        if entry.sha256 == sha256:
            raise KinemimicError(
                f"{catalog}: expected a new file, found {file} there already as {entry.name}"
            )
    told = {
        "repository": repository,
        "commit": commit,
        "licence": licence,
        "citation": citation,
        "title": title,
        "sensor": sensor,
        "shows": shows,
    }
    format, recorder, rate, why = _recognised(file)
    place = next((one for one in known.collections if one.name == collection), None)
    line: dict[str, str | int | float] = {"name": name, "path": path, "bytes": size, "sha256": sha256}
    if place is None:
        texts = {"title": collection, "sensor": recorder, "shows": _UNTOLD}
        texts |= {key: text for key, text in told.items() if text}
        if rate is not None:
            line["frame_rate"] = rate
        fresh = text + _new_collection(catalog, collection, format, texts, line)
    else:
        line |= _own(catalog, place, format, rate, told)
        fresh = _with_line(catalog, text, known, place, line)
    made = parse_catalog(catalog, fresh)
    added = [entry for entry in made.entries if entry not in known.entries]
    if len(added) != 1 or len(made.entries) != len(known.entries) + 1:
        raise _unwritable(catalog)
    with atomic(catalog) as temporary:
        temporary.write_bytes(fresh.encode())
    return added[0], why


def _there(catalog: Path) -> tuple[str, Catalog]:
    try:
        text = catalog.read_bytes().decode()
    except FileNotFoundError:
        return f"schema = {SCHEMA}\n", Catalog(catalog, ())
    except UnicodeDecodeError as error:
        raise KinemimicError(f"{catalog}: expected text in UTF-8, found {error.reason}") from None
    return text if text.endswith("\n") else f"{text}\n", parse_catalog(catalog, text)


def _recognised(file: Path) -> tuple[str | None, str, float | None, str | None]:
    """Format, sensor, frame rate (Hz), and why one of them is not known."""
    try:
        source = Source.open(file)
        reader = reader_of(source)
    except CaptureError as error:
        return None, _UNTOLD, None, f"no format of ours: {error}"
    known = reader.FORMAT
    try:
        return known.name, known.sensor, round(reader.read(source).rate, 2) or None, None
    except CaptureError as error:
        return known.name, known.sensor, None, f"frame rate not known: {error}"


def _own(
    catalog: Path, place: Collection, format: str | None, rate: float | None, told: Mapping[str, str | None]
) -> dict[str, str | int | float]:
    """What a file of a collection says for itself, because the collection says something else."""
    own: dict[str, str | int | float] = {}
    for key in ("licence", "citation", "title", "sensor", "shows"):
        if told.get(key) not in (None, there := getattr(place, key)):
            raise KinemimicError(
                f"{catalog}: expected --{key} {there!r}, which {place.name} has, found {told[key]!r}; "
                "make another --collection of it"
            )
    origin = (told.get("repository") or place.repository, told.get("commit") or place.commit)
    if origin != (place.repository, place.commit):
        own |= {"repository": origin[0], "commit": origin[1]}
    if format != place.format:
        own["format"] = format or NONE
    if format and rate != place.frame_rate:
        own["frame_rate"] = rate or 0
    return own


def _new_collection(
    catalog: Path,
    name: str,
    format: str | None,
    told: Mapping[str, str],
    line: dict[str, str | int | float],
) -> str:
    for key in ("repository", "commit", "licence", "citation"):
        if key not in told:
            raise KinemimicError(f"{catalog}: expected --{key} for the new collection {name!r}, found none")
    keys = (
        {"name": name} | {key: told[key] for key in ("title", "sensor", "shows")} | {"format": format or NONE}
    )
    keys |= {key: told[key] for key in ("licence", "citation", "repository", "commit")}
    head = "".join(f"{key} = {quoted(value)}\n" for key, value in keys.items())
    return f"\n[[collection]]\n{head}files = [\n{_inline(line)}]\n"


def _with_line(
    catalog: Path, text: str, known: Catalog, place: Collection, line: dict[str, str | int | float]
) -> str:
    """The text with one more file in a collection: right behind the bracket that opens its list, where a
    line fits whatever follows. The whole is parsed again before anything is written."""
    heads = [found.start() for found in re.finditer(r"^[ \t]*\[\[\s*collection\s*\]\]", text, re.MULTILINE)]
    number = known.collections.index(place)
    if len(heads) != len(known.collections):
        raise _unwritable(catalog)
    opened = re.compile(r"^[ \t]*files[ \t]*=[ \t]*\[[ \t]*\n?", re.MULTILINE).search(text, heads[number])
    if opened is None:
        raise _unwritable(catalog)
    before = text[: opened.end()]
    return (before if before.endswith("\n") else f"{before}\n") + _inline(line) + text[opened.end() :]


def _inline(line: dict[str, str | int | float]) -> str:
    pairs = (f"{key} = {quoted(value) if isinstance(value, str) else value}" for key, value in line.items())
    return f"  {{ {', '.join(pairs)} }},\n"


def _unwritable(catalog: Path) -> KinemimicError:
    return KinemimicError(
        f"{catalog}: expected [[collection]] and files = [ at the beginnings of lines, found another form of "
        "TOML; write the entry by hand"
    )


@click.command("add")
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--catalog", type=click.Path(path_type=Path), required=True, help="One's own; made if there is none."
)
@click.option("--collection", required=True, metavar="NAME", help="The folder that the file is fetched into.")
@click.option("--as", "name", metavar="NAME", help="The file's name there; by default its own.")
@click.option("--path", required=True, help="The file's path in its repository.")
@click.option("--repository", metavar="OWNER/NAME", help="Where it is published on GitHub.")
@click.option("--commit", metavar="SHA", help="Of the repository: 40 hexadecimal digits.")
@click.option("--licence", help='As stated there, or "none stated".')
@click.option("--citation", help="Whom to cite.")
@click.option("--title", help="What the collection is, in a few words.")
@click.option("--sensor", help="By default what the file's format is recorded with.")
@click.option("--shows", help="What is to be seen, and what to look out for.")
@json_option("Print the entry as JSON.")
def command(file: Path, catalog: Path, collection: str, as_json: bool, **told: str | None) -> None:
    """Write a FILE that is here into a catalogue of one's own: size, SHA-256, format and frame rate.

    A new collection needs --repository, --commit, --licence and --citation; one that is there has them.

    \b
      kinemimic datasets add walk.skl --catalog mine.toml --collection home --path data/walk.skl \\
        --repository me/walks --commit 0123456789abcdef0123456789abcdef01234567 \\
        --licence CC0-1.0 --citation "Me, 2026"
    """
    path, name = told.pop("path") or "", told.pop("name")
    entry, why = add(file, catalog, collection, path=path, name=name, **told)
    if as_json:
        click.echo(
            json.dumps({**asdict(entry), "address": entry.address, "note": why}, indent=2, ensure_ascii=False)
        )
        return
    if why:
        click.echo(why, err=True)
    rate = "" if entry.frame_rate is None else f", {entry.frame_rate:.4g} Hz"
    click.echo(f"{catalog}: {entry.name}: {entry.format or 'no format of ours'}{rate}, {entry.bytes:,} bytes")
    click.echo(entry.address)
