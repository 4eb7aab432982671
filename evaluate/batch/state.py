"""The state of a folder of batches: the row of every capture, and which batch is processing it.

The rows are in one SQLite file, so that any number of batches may write there, and a batch that is killed
leaves what it had finished. A batch that processes a capture holds an operating-system lock on
one byte of another file; the lock ends with the process, even a killed one.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.run_folder.lock import where_supported

STATE, LOCKS = "batch.sqlite", ".batch.lock"
STATE_SCHEMA = 1
_PATIENCE = 60.0  # seconds that a write waits for those of other batches
_TABLES = """
CREATE TABLE IF NOT EXISTS captures (name TEXT PRIMARY KEY, capture TEXT NOT NULL UNIQUE, kept TEXT);
CREATE TABLE IF NOT EXISTS facts (name TEXT PRIMARY KEY, value TEXT NOT NULL);
"""
_WHOLE = 0  # the byte whose lock is the folder's; the bytes of captures follow


@dataclass(frozen=True)
class Kept:
    """A capture's row, and what it was made from (`evaluate.batch.task.made_from`), as JSON values."""

    row: dict[str, Any]
    made_from: dict[str, Any]


class BatchState:
    """The rows of a folder, by the name of a capture: its run folder's path in this one.

    KinemimicError for a file that is damaged or of another version, and where SQLite cannot write.
    """

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._path = folder / STATE
        self._locks = os.open(folder / LOCKS, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            with self._errors():
                self._rows = sqlite3.connect(self._path, timeout=_PATIENCE, isolation_level=None)
                self._rows.executescript(_TABLES)
                (schema,) = self._rows.execute("PRAGMA user_version").fetchone()
                if schema not in (0, STATE_SCHEMA):
                    raise KinemimicError(
                        f"{self._path}: expected the rows of batches of schema {STATE_SCHEMA}, found "
                        f"{schema}, written by a later version of kinemimic; install that version, or choose "
                        "another --out"
                    )
                self._rows.execute(f"PRAGMA user_version = {STATE_SCHEMA}")
        except KinemimicError:
            os.close(self._locks)
            raise

    def close(self) -> None:
        """Close the files; all locks end."""
        self._rows.close()
        os.close(self._locks)

    def __enter__(self) -> BatchState:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def names(self, wanted: Mapping[Path, str]) -> dict[Path, str]:
        """The name of each capture: the one that it has, else the wanted one.

        A capture gets another name than the wanted one where a different capture, which still exists, has it.
        """
        found: dict[Path, str] = {}
        with self._errors(), self._transaction():
            owners = dict(self._rows.execute("SELECT name, capture FROM captures"))
            # Earlier versions stored paths with "..", and let names lead out of the folder.
            known = {
                str(place_of(Path(capture))): name
                for name, capture in owners.items()
                if ".." not in Path(name).parts
            }
            for capture, name in wanted.items():
                place, name = _text(str(place_of(capture))), _text(name)  # noqa: PLW2901
                if place not in known:
                    owner = owners.get(name)
                    if owner is not None and Path(owner).exists():
                        path = Path(name)
                        mark = hashlib.sha256(os.fsencode(place)).hexdigest()[:8]
                        name = path.with_name(f"{path.stem}-{mark}{path.suffix}").as_posix()  # noqa: PLW2901
                    # Of one that has moved here, the row stays: its content tells whether it is up to date.
                    self._rows.execute(
                        "INSERT INTO captures (name, capture) VALUES (?, ?) "
                        "ON CONFLICT (name) DO UPDATE SET capture = excluded.capture",
                        (name, place),
                    )
                    known[place], owners[name] = name, place
                found[capture] = known[place]
        return found

    def get(self, name: str) -> Kept | None:
        """What is kept of a capture."""
        with self._errors():
            found = self._rows.execute("SELECT kept FROM captures WHERE name = ?", (_text(name),)).fetchone()
        return _kept(found[0]) if found is not None else None

    def put(self, name: str, kept: Kept) -> None:
        """Keep this of a capture that has a name."""
        text = json.dumps({"row": kept.row, "made_from": kept.made_from}, allow_nan=False)
        with self._errors():
            self._rows.execute("UPDATE captures SET kept = ? WHERE name = ?", (text, _text(name)))

    def rows(self) -> dict[str, tuple[Path, Kept]]:
        """Name -> path of the capture, and what is kept of it; of all that have a row, sorted by name."""
        query = "SELECT name, capture, kept FROM captures WHERE kept IS NOT NULL ORDER BY name"
        with self._errors():
            found = [(name, Path(capture), _kept(kept)) for name, capture, kept in self._rows.execute(query)]
        return {name: (capture, kept) for name, capture, kept in found if kept is not None}

    def forget(self, names: Iterable[str]) -> None:
        """Drop captures."""
        with self._errors(), self._transaction():
            self._rows.executemany("DELETE FROM captures WHERE name = ?", [(_text(name),) for name in names])

    def fact(self, name: str) -> str | None:
        """A text that `set_fact` has stored."""
        with self._errors():
            found = self._rows.execute("SELECT value FROM facts WHERE name = ?", (name,)).fetchone()
        return None if found is None else str(found[0])

    def set_fact(self, name: str, value: str) -> None:
        """Store a text about the whole folder."""
        with self._errors():
            self._rows.execute("INSERT OR REPLACE INTO facts VALUES (?, ?)", (name, value))

    def claim(self, name: str) -> bool:
        """Whether no other process works on this capture; if so, none does until `release`.

        On a file system without locks, every process may.
        """
        try:
            self._lock(fcntl.LOCK_EX | fcntl.LOCK_NB, _byte(name))
        except (BlockingIOError, PermissionError):
            return False
        return True

    def release(self, name: str) -> None:
        """End a claim."""
        self._lock(fcntl.LOCK_UN, _byte(name))

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Wait until no other process is within this block, and keep others waiting."""
        self._lock(fcntl.LOCK_EX, _WHOLE)
        try:
            yield
        finally:
            self._lock(fcntl.LOCK_UN, _WHOLE)

    def _lock(self, operation: int, byte: int) -> None:
        with where_supported():
            fcntl.lockf(self._locks, operation, 1, byte)

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        self._rows.execute("BEGIN IMMEDIATE")
        try:
            yield
        except BaseException:
            self._rows.execute("ROLLBACK")
            raise
        self._rows.execute("COMMIT")

    @contextmanager
    def _errors(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.OperationalError as error:
            raise KinemimicError(f"{self._path}: expected to read and write it, found {error}") from None
        except sqlite3.DatabaseError as error:
            raise KinemimicError(
                f"{self._path}: expected the rows of batches, found {error}; delete it, and all captures are "
                "processed again"
            ) from None


def place_of(path: Path) -> Path:
    """The absolute path without "..", by which captures and folders are told apart."""
    plain = Path(os.path.abspath(path))  # noqa: PTH100 (`resolve` follows links)
    if ".." not in path.parts or not path.exists() or (plain.exists() and plain.samefile(path)):
        return plain
    # Beyond a link, ".." is another folder than the one in which the link is.
    return path.resolve()


def _byte(name: str) -> int:
    """The place of a capture in the file of locks. A lock beyond the end of a file takes no space."""
    return 1 + int.from_bytes(hashlib.sha256(os.fsencode(name)).digest()[:7])


def _text(name: str) -> str:
    """A file name that SQLite can store: one that is not UTF-8 has surrogates in Python."""
    return os.fsencode(name).decode("utf-8", "backslashreplace")


def _kept(text: str | None) -> Kept | None:
    """None for no row, and for one that is damaged."""
    if text is None:
        return None
    try:
        value = json.loads(text)
        return Kept(dict(value["row"]), dict(value["made_from"]))
    except (ValueError, KeyError, TypeError):
        return None
