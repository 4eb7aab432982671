"""Entries of the catalogue: collections of files, each with its URL and hash."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from urllib.parse import quote

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.data_folder import DATASETS

HOST = "https://raw.githubusercontent.com"


@dataclass(frozen=True)
class Entry:
    """One file of a collection.

    collection, file: local folder and file name; bytes, sha256: size and hash of the published file;
    repository ("owner/name"), commit, path: its location on GitHub; licence: as stated there; format: name
    of the capture format, None if no reader supports it; frame_rate: Hz, None if unknown.
    """

    collection: str
    file: str
    bytes: int
    sha256: str
    repository: str
    commit: str
    path: str
    licence: str
    format: str | None
    frame_rate: float | None

    @property
    def name(self) -> str:
        """The full name, such as "kinect1_bernstein_skl/r2.skl"."""
        return f"{self.collection}/{self.file}"

    @property
    def url(self) -> str:
        """The URL of the published file."""
        return self.url_at(HOST)

    def url_at(self, base: str) -> str:
        """The URL on a mirror of GitHub's host of raw files."""
        return f"{base.rstrip('/')}/{quote(f'{self.repository}/{self.commit}/{self.path}')}"


@dataclass(frozen=True)
class Collection:
    """Files of one origin; format and frame_rate (Hz) are the defaults of its files."""

    name: str
    title: str
    sensor: str
    shows: str
    format: str | None
    frame_rate: float | None
    licence: str
    citation: str
    repository: str
    commit: str
    entries: tuple[Entry, ...]


@dataclass(frozen=True)
class Catalog:
    """The collections of a catalogue; path: the file that it was read from."""

    path: Path
    collections: tuple[Collection, ...]

    @property
    def entries(self) -> tuple[Entry, ...]:
        """Every file, in the order of the catalogue."""
        return tuple(entry for collection in self.collections for entry in collection.entries)

    def entry(self, name: str) -> Entry:
        """The file of that name ("collection/file"); KinemimicError if there is none."""
        for entry in self.entries:
            if entry.name == name:
                return entry
        raise self._unknown(name)

    def select(self, names: Iterable[str]) -> tuple[Entry, ...]:
        """The files that match any of the names or patterns (* ? []), each once, in catalogue order.

        A name is a collection, a file, or collection/file. KinemimicError for a name without a match.
        """
        chosen: set[str] = set()
        for name in names:
            found = {entry.name for entry in self.entries if _matches(name, entry)}
            if not found:
                raise self._unknown(name)
            chosen |= found
        return tuple(entry for entry in self.entries if entry.name in chosen)

    def _unknown(self, name: str) -> KinemimicError:
        known = [collection.name for collection in self.collections]
        known += [spelt for entry in self.entries for spelt in (entry.name, entry.file)]
        near = difflib.get_close_matches(name, known, n=1)
        advice = f"did you mean {near[0]!r}?" if near else "`kinemimic datasets list` lists the names"
        # The path of the shipped catalogue would mean nothing to the user.
        place = "" if self.path.is_relative_to(DATASETS) else f"{self.path}: "
        some = ", ".join(one.name for one in self.collections[:5])
        more = ", …" if len(self.collections) > 5 else ""
        return KinemimicError(
            f"{place}expected a collection ({some}{more}) or a file of the catalogue, found {name!r}; "
            f"{advice}"
        )


def collections_of(catalog: Catalog, entries: Sequence[Entry]) -> tuple[Collection, ...]:
    """The collections that entries belong to."""
    names = {entry.collection for entry in entries}
    return tuple(collection for collection in catalog.collections if collection.name in names)


def _matches(pattern: str, entry: Entry) -> bool:
    names = (entry.collection, entry.name, entry.file)
    return pattern in names or any(fnmatchcase(name, pattern) for name in names)
