"""The catalogue from its TOML file, every key checked: a mistake is told with its line and key."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

from kinemimic.pipeline.catalog.entry import Catalog, Collection, Entry
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.bounded import MEGABYTE, read_bounded
from kinemimic.pipeline.files.data_folder import DATASETS
from kinemimic.pipeline.files.toml_keys import Keys, parse_toml

CATALOG = DATASETS / "catalog.toml"
SCHEMA = 1
NONE = "none"  # the format of what no reader takes
MAX_BYTES = 16 * MEGABYTE  # of a catalogue
MAX_COLLECTIONS = 10_000
MAX_FILES = 100_000  # of a collection
LARGEST = 2**40  # bytes of a file
FASTEST = 100_000.0  # Hz

# Characters that a terminal does not show, or by which it shows others in another sequence.
_UNSEEN = r"\x00-\x1f\x7f-\x9f\xad\u061c\u200b\u200e\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb"
# Names become folders and files of the user's: one component each, not hidden, of characters that a terminal
# shows as they are.
_COLLECTION = r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}"
_FILE = rf"[^\W.][^/\\{_UNSEEN}]{{0,199}}"
_REPOSITORY = r"[A-Za-z0-9_-][A-Za-z0-9_.-]*/[A-Za-z0-9_-][A-Za-z0-9_.-]*"
_PATH = rf"(?!.*(?:^|/)\.{{0,2}}(?:/|$))[^\\{_UNSEEN}]{{1,1000}}"
_TEXT = rf"(?=.*\S)[^{_UNSEEN}]{{1,2000}}"


def load_catalog(path: Path = CATALOG) -> Catalog:
    """The catalogue of a file, by default that which ships.

    A KinemimicError, in one line, names the line and the key of the first mistake.
    """
    try:
        text = read_bounded(path, MAX_BYTES, "a catalogue").decode("utf-8")
    except FileNotFoundError:
        raise KinemimicError(f"{path}: expected a catalogue, found no file") from None
    except UnicodeDecodeError as error:
        raise KinemimicError(f"{path}: expected text in UTF-8, found {error.reason}") from None
    return parse_catalog(path, text)


def parse_catalog(path: Path, text: str) -> Catalog:
    """The catalogue of a text; path: what messages call it."""
    keys = Keys(path, "", parse_toml(path, text))
    if keys.get("schema") != SCHEMA or isinstance(keys.get("schema"), bool):
        keys.fail("schema", expected=f"{SCHEMA}", found=keys.get("schema"))
    lines = _Lines(text)
    made: dict[str, Collection] = {}
    for number, table in enumerate(_tables(keys, "collection", MAX_COLLECTIONS), 1):
        here = Keys(lines.of_collection(path, number), f"collection[{number}]", table)
        collection = _collection(path, here, lines, number)
        if collection.name in made:
            _twice(here, collection.name)
        made[collection.name] = collection
    keys.finish()
    return Catalog(path, tuple(made.values()))


def _collection(path: Path, keys: Keys, lines: _Lines, number: int) -> Collection:
    name = _matching(keys, "name", _COLLECTION, "a folder's name (letters, digits, _ - .)")
    text = {key: _matching(keys, key, _TEXT, "a line of text") for key in ("title", "sensor", "shows")}
    format = _format(keys, None)
    rate = _rate(keys, None)
    licence, citation = (_matching(keys, key, _TEXT, "a line of text") for key in ("licence", "citation"))
    repository, commit = _place(keys, None, None)
    entries: dict[str, Entry] = {}
    for place, table in enumerate(_tables(keys, "files", MAX_FILES), 1):
        here = _FileKeys(path, f"{name}.files[{place}]", table, lines, number)
        own_format = _format(here, format)
        own_place = _place(here, repository, commit)
        entry = Entry(
            collection=name,
            file=_matching(here, "name", _FILE, "a file's name, without a folder and not hidden"),
            bytes=_bytes(here),
            sha256=_matching(here, "sha256", "[0-9a-f]{64}", "64 hexadecimal digits, in lower case"),
            repository=own_place[0],
            commit=own_place[1],
            path=_matching(here, "path", _PATH, 'a path within the repository, without ".." and empty parts'),
            licence=licence,
            format=own_format,
            frame_rate=_rate(here, None if own_format is None else rate),
        )
        here.finish()
        if entry.file in entries:
            _twice(here, entry.file)
        entries[entry.file] = entry
    if not entries:
        keys.fail("files", expected="at least one file", found="none")
    keys.finish()
    return Collection(
        name=name,
        **text,
        format=format,
        frame_rate=rate,
        licence=licence,
        citation=citation,
        repository=repository,
        commit=commit,
        entries=tuple(entries.values()),
    )


def _tables(keys: Keys, key: str, most: int) -> Sequence[dict[str, Any]]:
    value = keys.get(key)
    if value is None:
        return ()
    if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
        keys.fail(key, expected="a list of tables", found=repr(value))
    if len(value) > most:
        keys.fail(key, expected=f"at most {most:,}", found=f"{len(value):,}")
    return value


def _matching(keys: Keys, key: str, pattern: str, expected: str, default: str | None = None) -> str:
    value = keys.get(key)
    if value is None and default is not None:
        return default
    if not isinstance(value, str) or not re.fullmatch(pattern, value):
        keys.fail(key, expected=expected, found=None if value is None else repr(value))
    return value


def _place(keys: Keys, repository: str | None, commit: str | None) -> tuple[str, str]:
    """Repository and commit; a file's are the collection's unless it has its own."""
    return (
        _matching(keys, "repository", _REPOSITORY, "a repository on GitHub, OWNER/NAME", repository),
        _matching(keys, "commit", "[0-9a-f]{40}", "a commit, 40 hexadecimal digits in lower case", commit),
    )


def _format(keys: Keys, default: str | None) -> str | None:
    expected = f"a format's name as `kinemimic formats` has it, or {NONE!r}"
    value = _matching(keys, "format", _TEXT, expected, NONE if default is None else default)
    return None if value == NONE else value


def _rate(keys: Keys, default: float | None) -> float | None:
    """Hz; 0 says that there is none, where the collection has one."""
    value = keys.number("frame_rate", 0.0, FASTEST)
    return default if value is None else value or None


def _bytes(keys: Keys) -> int:
    value = keys.get("bytes")
    if not isinstance(value, int) or isinstance(value, bool) or not 1 <= value <= LARGEST:
        keys.fail("bytes", expected="the file's size in bytes, a whole number from 1", found=value)
    return value


def _twice(keys: Keys, name: str) -> NoReturn:
    keys.fail("name", expected="a name that nothing else has", found=f"{name!r} for the second time")


class _Lines:
    """Where a collection and a file of it stand in the text, as far as that can be told from how it looks."""

    def __init__(self, text: str) -> None:
        self._lines = text.split("\n")
        self._heads = [
            number
            for number, line in enumerate(self._lines, 1)
            if re.match(r"\s*\[\[\s*collection\s*\]\]", line)
        ]

    def of_collection(self, path: Path, number: int) -> Path:
        """`path`, and the line of the collection's head behind it."""
        known = number <= len(self._heads)
        return Path(f"{path}, line {self._heads[number - 1]}") if known else path

    def of_file(self, path: Path, number: int, name: object) -> Path:
        """The same of a file of the collection; of the collection, where the file has no name."""
        if isinstance(name, str) and number <= len(self._heads):
            begin = self._heads[number - 1]
            end = self._heads[number] - 1 if number < len(self._heads) else len(self._lines)
            mark = re.compile(rf"\bname\s*=\s*[\"']{re.escape(name)}[\"']")
            for line in range(begin, end):
                if mark.search(self._lines[line]):
                    return Path(f"{path}, line {line + 1}")
        return self.of_collection(path, number)


class _FileKeys(Keys):
    """The keys of a file of collection `number`; its line is looked for only when a mistake is told."""

    def __init__(self, path: Path, name: str, values: Mapping[str, Any], lines: _Lines, number: int) -> None:
        super().__init__(path, name, values)
        self._lines, self._number = lines, number

    def fail(self, key: str, *, expected: str, found: Any, advice: str | None = None) -> NoReturn:
        self.path = self._lines.of_file(self.path, self._number, self.values.get("name"))
        super().fail(key, expected=expected, found=found, advice=advice)
