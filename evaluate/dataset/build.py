"""Makes the data set of a folder from what batches have left there, if anything has changed.

It is written beside the old one and takes its place in one move, so that index and shards always belong
together. The same rows and motions give the same bytes.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, closing
from pathlib import Path
from typing import Any, Protocol

from kinemimic.evaluate.dataset.card import write_card
from kinemimic.evaluate.dataset.drawing import Drawing, drawing_of
from kinemimic.evaluate.dataset.page import write_page
from kinemimic.pipeline.catalog.load import load_catalog
from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.provenance import versions
from kinemimic.pipeline.files.sidecars import beside
from kinemimic.pipeline.files.store import file_hash
from kinemimic.retarget.dataset.columns import DATASET_SCHEMA, INDEX, INDEX_COLUMNS, SUMS
from kinemimic.retarget.dataset.index_table import write_rows, write_sums
from kinemimic.retarget.dataset.shards import ShardWriter
from kinemimic.retarget.dataset.split import SPLITS, split_of, subject_of, subject_pattern
from kinemimic.retarget.formats.motion_json import MOTION, read_motion_json
from kinemimic.retarget.humanoid.motion import Motion

DATASET, PAGE = "dataset", "index.html"
_NEW, _OLD = ".dataset-new", ".dataset-old"
_MADE, _SUBJECT = "dataset", "subject"  # facts of the state

Row = dict[str, Any]


class State(Protocol):
    """The rows of a folder of batches (`evaluate.batch.state`)."""

    def rows(self) -> Mapping[str, tuple[Path, Any]]: ...
    def fact(self, name: str) -> str | None: ...
    def set_fact(self, name: str, value: str) -> None: ...
    def alone(self) -> AbstractContextManager[None]: ...


def refresh(folder: Path, state: State, *, subject: str | None = None) -> bool:
    """Make the data set and the page of `folder`, unless they are up to date; returns whether they were made.

    subject: as `subject_pattern`; None: that of the last call. A motion that another batch has removed or
    replaced meanwhile, to make it again, is left out until the next call; without any other row, the old data
    set stays.
    """
    with state.alone():
        chosen = subject if subject is not None else state.fact(_SUBJECT)
        pattern = subject_pattern(chosen or None)
        rows = list(_captures(state))
        made = _digest(rows, pattern.pattern)
        if state.fact(_MADE) == made and _whole(folder):
            return False
        if not rows:
            return False
        new, old = folder / _NEW, folder / _OLD
        for rest in (new, old):
            shutil.rmtree(rest, ignore_errors=True)
        new.mkdir()
        try:
            licences = {entry.sha256: entry.licence for entry in load_catalog().entries}
            index = [_described(row, pattern, licences) for row, _ in rows]
            hashes = {row["name"]: _motion_hash(made_from) for row, made_from in rows}
            drawings, lost = _write_motions(new, folder, index, hashes)
            index = [row for row in index if row["name"] not in lost]
            if not index:
                return False
            write_rows(new, index)
            write_card(new, index)
            write_sums(new)
            _replace(folder / DATASET, new, old)
            write_page(folder / PAGE, index, drawings)
        finally:
            shutil.rmtree(new, ignore_errors=True)
        state.set_fact(_SUBJECT, chosen or "")
        state.set_fact(_MADE, "" if lost else made)
    return True


def _captures(state: State) -> Iterator[tuple[Row, Row]]:
    """The row of each capture, without other files and files that are read with another; made from."""
    read_with: set[Path] = set()
    for _, (capture, kept) in state.rows().items():
        if kept.row["status"] != "other" and capture not in read_with:
            read_with |= {beside(capture, name) for name in kept.row["sidecar_files"]}
            yield kept.row, kept.made_from


def _digest(rows: Sequence[tuple[Row, Row]], pattern: str) -> str:
    """Of everything that the data set is made from."""
    told = [
        [
            {key: value for key, value in row.items() if key not in ("file", "folder", "seconds")},
            {name: mark and mark[2] for name, mark in made.get("outputs", {}).items()},
        ]
        for row, made in rows
    ]
    content = [DATASET_SCHEMA, versions().get("kinemimic"), pattern, told]
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _whole(folder: Path) -> bool:
    """Whether all files of the data set, and the page, are there."""
    sums = folder / DATASET / SUMS
    if not sums.is_file() or not (folder / PAGE).is_file():
        return False
    names = [line.partition("  ")[2] for line in sums.read_text(encoding="utf-8").splitlines()]
    return INDEX in names and all((folder / DATASET / name).is_file() for name in names)


def _described(row: Row, pattern: Any, licences: Mapping[str, str]) -> Row:
    """The row with person, split and licence; all columns are keys."""
    subject = row["subject"] or subject_of(row["name"], pattern)
    licence = row["licence"] or licences.get(row["sha256"] or "")
    return (
        dict.fromkeys(INDEX_COLUMNS)
        | row
        | {"subject": subject, "split": split_of(subject), "licence": licence}
    )


def _write_motions(
    new: Path, folder: Path, index: Sequence[Row], hashes: Mapping[str, str | None]
) -> tuple[dict[str, Drawing], set[str]]:
    """Write the shards; completes the rows, and returns the drawings of the motions by name, and the names of
    motions that are not those of their rows any more. hashes: of motion.json, by name."""
    drawings: dict[str, Drawing] = {}
    lost: set[str] = set()
    accepted = [row for row in index if row["status"] == "accepted" and row["kind"] is not None]
    with ExitStack() as stack, progress("data set", len(accepted), unit="motions") as bar:
        writers = {split: stack.enter_context(closing(ShardWriter(new, split))) for split in SPLITS}
        for row in accepted:
            motion = _motion(folder / row["name"] / MOTION, hashes[row["name"]])
            if motion is None:
                lost.add(row["name"])
                continue
            row |= {
                "motion": motion.identity,
                "motion_frames": len(motion.root),
                "motion_rate_hz": float(motion.rate),
                "cycle_offset_m": [float(value) for value in motion.cycle_offset],
                "shard": writers[row["split"]].add(row["name"], row["subject"], row["kind"], motion),
            }
            drawings[row["name"]] = drawing_of(motion)
            bar.advance(1.0)
    return drawings, lost


def _motion_hash(made_from: Row) -> str | None:
    """The hash of the motion.json that a row is about."""
    mark = made_from.get("outputs", {}).get(MOTION)
    return None if mark is None else str(mark[2])


def _motion(path: Path, sha256: str | None) -> Motion | None:
    """The motion in a file; None if the file is gone, or another one."""

    def is_same() -> bool:
        return path.is_file() and file_hash(path) == sha256

    try:
        motion = read_motion_json(path)
    except (KinemimicError, OSError):
        if is_same():
            raise
        return None
    return motion if is_same() else None


def _replace(place: Path, new: Path, old: Path) -> None:
    """Put a folder in the place of another. A process that is killed between the two moves leaves none, and
    the next batch makes it."""
    if place.is_symlink() or (place.exists() and not place.is_dir()):
        raise KinemimicError(f"{place}: expected a folder or nothing, found a file; move it elsewhere")
    if place.exists():
        if any(place.iterdir()) and not (place / INDEX).exists():
            raise KinemimicError(
                f"{place}: expected a data set of `batch` or nothing, found other files; move them elsewhere"
            )
        place.replace(old)
    new.replace(place)
    shutil.rmtree(old, ignore_errors=True)
