"""The catalogue from its TOML file; errors name the line and the key."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from msgspec import Meta, Struct
from msgspec.structs import asdict

from kinemimic.pipeline.catalog.entry import Catalog, Collection, Entry
from kinemimic.pipeline.files.data_folder import DATASETS
from kinemimic.pipeline.files.validation.bounded import MEGABYTE
from kinemimic.pipeline.files.validation.records import RecordError, Steps, convert, dotted, short
from kinemimic.pipeline.files.validation.toml_file import parse_toml, read_text

CATALOG = DATASETS / "catalog.toml"
SCHEMA = 1
NONE = "none"  # the format of files that no reader supports
MAX_BYTES = 16 * MEGABYTE  # of a catalogue

# Characters that a terminal does not show, or that change the order in which it shows others.
_UNSEEN = r"\x00-\x1f\x7f-\x9f\xad\u061c\u200b\u200e\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb"
_TEXT = rf"(?=.*\S)[^{_UNSEEN}]{{1,2000}}"


def _matching(pattern: str, description: str) -> Meta:
    return Meta(pattern=rf"\A(?:{pattern})\Z", description=description)


_Text = Annotated[str, _matching(_TEXT, "a line of text")]
_Format = Annotated[str, _matching(_TEXT, f"a format's name as in `kinemimic formats`, or {NONE!r}")]
# Names become the names of the user's folders and files: one path component each, not hidden, and only
# characters that a terminal shows unchanged.
_FOLDER_NAME = r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}"
_FolderName = Annotated[str, _matching(_FOLDER_NAME, "a folder's name (letters, digits, _ - .)")]
_FILE_NAME = rf"[^\W.][^/\\{_UNSEEN}]{{0,199}}"
_FileName = Annotated[str, _matching(_FILE_NAME, "a file's name, without a folder and not hidden")]
_PATH = rf"(?!.*(?:^|/)\.{{0,2}}(?:/|$))[^\\{_UNSEEN}]{{1,1000}}"
_Path = Annotated[str, _matching(_PATH, 'a path within the repository, without ".." and empty parts')]
_REPOSITORY = r"[A-Za-z0-9_-][A-Za-z0-9_.-]*/[A-Za-z0-9_-][A-Za-z0-9_.-]*"
_Repository = Annotated[str, _matching(_REPOSITORY, "a repository on GitHub, OWNER/NAME")]
_Commit = Annotated[str, _matching("[0-9a-f]{40}", "a commit, 40 hexadecimal digits in lower case")]
_Sha256 = Annotated[str, _matching("[0-9a-f]{64}", "64 hexadecimal digits, in lower case")]
_Size = Annotated[int, Meta(ge=1, le=2**40, description="the file's size in bytes, a whole number from 1")]
_Rate = Annotated[float, Meta(ge=0.0, le=100_000.0)]  # Hz; 0 for files without one


class _File(Struct, frozen=True, forbid_unknown_fields=True):
    """A value of None means that of the collection."""

    name: _FileName
    bytes: _Size
    sha256: _Sha256
    path: _Path
    repository: _Repository | None = None
    commit: _Commit | None = None
    format: _Format | None = None
    frame_rate: _Rate | None = None


class _Collection(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    name: _FolderName
    title: _Text
    sensor: _Text
    shows: _Text
    licence: _Text
    citation: _Text
    repository: _Repository
    commit: _Commit
    format: _Format = NONE
    frame_rate: _Rate = 0.0
    files: Annotated[
        tuple[_File, ...], Meta(min_length=1, max_length=100_000, description="1 to 100,000 files")
    ]

    def __post_init__(self) -> None:
        _check_unique("files", [file.name for file in self.files])


class _Document(Struct, frozen=True, forbid_unknown_fields=True):
    schema: Literal[1]
    collection: Annotated[tuple[_Collection, ...], Meta(max_length=10_000)] = ()

    def __post_init__(self) -> None:
        _check_unique("collection", [one.name for one in self.collection])


def load_catalog(path: Path = CATALOG) -> Catalog:
    """The catalogue of a file, by default the shipped one.

    KinemimicError, in one line, for the first mistake.
    """
    return parse_catalog(path, read_text(path, MAX_BYTES, "a catalogue"))


def parse_catalog(path: Path, text: str) -> Catalog:
    """The catalogue of a text; path: its name in messages."""
    values = parse_toml(path, text)
    document = convert(values, _Document, path, where=lambda steps: _where(steps, values, text))
    return Catalog(path, tuple(map(_collection, document.collection)))


def _collection(made: _Collection) -> Collection:
    def entry(file: _File) -> Entry:
        format = file.format or made.format
        shared_rate = None if format == NONE else made.frame_rate
        return Entry(
            collection=made.name,
            file=file.name,
            bytes=file.bytes,
            sha256=file.sha256,
            repository=file.repository or made.repository,
            commit=file.commit or made.commit,
            path=file.path,
            licence=made.licence,
            format=None if format == NONE else format,
            frame_rate=(shared_rate if file.frame_rate is None else file.frame_rate) or None,
        )

    fields = asdict(made)
    fields |= {
        "format": None if made.format == NONE else made.format,
        "frame_rate": made.frame_rate or None,
        "entries": tuple(map(entry, fields.pop("files"))),
    }
    return Collection(**fields)


def _check_unique(key: str, names: Sequence[str]) -> None:
    first = {name: index for index, name in reversed([*enumerate(names)])}
    for index, name in enumerate(names):
        if first[name] < index:
            found = f"{name!r} a second time"
            raise RecordError(key, index, "name", expected="a name that is not used elsewhere", found=found)


def _where(steps: Steps, values: Any, text: str) -> str:
    """ "line 16, key walks.files[1].path": the line of the file, or of its collection, if it can be found."""
    lines = text.split("\n")
    heads = [at for at, line in enumerate(lines) if re.match(r"\s*\[\[\s*collection\s*\]\]", line)]
    at: int | None = None
    match steps:
        case ("collection", int(number), *further) if number < len(heads):
            at, end = heads[number], (*heads, len(lines))[number + 1]
            collection = values["collection"][number]
            match further:
                case ("files", int(index), str(), *_):
                    name = re.escape(str(collection["files"][index].get("name")))
                    mark = re.compile(rf"\bname\s*=\s*[\"']{name}[\"']")
                    at = next((line for line in range(at, end) if mark.search(lines[line])), at)
                    steps = (str(collection.get("name")), *further)
    return f"{'' if at is None else f'line {at + 1}, '}key {short(dotted(steps))}"
