"""`kinemimic datasets diff`: differences between two data sets as motions, not as bytes."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.cli.options import json_option
from kinemimic.pipeline.cli.terminal import grid, show
from kinemimic.pipeline.convert import read_converted
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.canonical import FORMAT, Canonical
from kinemimic.pipeline.files.store import read_clip, read_json
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.retarget.dataset.index_table import is_dataset
from kinemimic.retarget.formats.motion_json import MOTION_FORMAT, read_motion_json
from kinemimic.retarget.versions.build import STAGES, canonical_motion

EXIT_DIFFERENT = 1  # exit status

# How arrays are compared, by kind.
_LENGTHS = ("positions", "translations", "root", "offsets", "cycle_offset")
_ROTATIONS = ("rotations", "rests", "world_from_file")
_COUNTED = ("states", "passes", "contacts", "cyclic", "parents")
_OF_SKELETON = ("offsets", "rests", "parents")
# Changes of a whole array or of the facts about it, without a measured difference.
_WHOLE = ("fact", "array", "shape")


@dataclass(frozen=True)
class Change:
    """A difference of one array at one joint.

    array: its name; joint: or side, None if it has neither; largest: greatest difference, in `unit`;
    unit: or one of `_WHOLE`; frame: of `largest`, None without frames; frames: number that differ.
    """

    array: str
    joint: str | None
    largest: float
    unit: str
    frame: int | None
    frames: int


def find_changes(before: Canonical, after: Canonical) -> list[Change]:
    """The differences by array and joint, largest first; KinemimicError for different kinds or joints."""
    if before.kind != after.kind:
        raise KinemimicError(f"expected two files of one kind, found a {before.kind} and a {after.kind}")
    if before.joints != after.joints:
        raise KinemimicError(
            f"expected the same joints, found {len(before.joints)} and {len(after.joints)}: "
            f"{', '.join(sorted(set(before.joints) ^ set(after.joints))) or 'in another order'}"
        )
    found = [
        Change(f"{name}, {was} before, {now} after", None, 1.0, "fact", None, 0)
        for name in sorted(before.facts.keys() | after.facts.keys())
        if (was := before.facts.get(name)) != (now := after.facts.get(name))
    ]
    for name in sorted(before.arrays.keys() | after.arrays.keys()):
        one, other = before.arrays.get(name), after.arrays.get(name)
        if one is None or other is None:
            change = "added" if one is None else "removed"
            found.append(Change(f"{name}, {change}", None, 1.0, "array", None, 0))
        elif one.shape != other.shape:
            lengths = [" × ".join(map(str, array.shape)) or "one number" for array in (one, other)]
            shapes = f"{name}, {lengths[0]} before, {lengths[1]} after"
            found.append(Change(shapes, None, 1.0, "shape", None, 0))
        else:
            found += _array_changes(name, one, other, before.joints)
    return sorted(found, key=lambda one: (one.unit not in _WHOLE, -one.largest))


def _array_changes(name: str, one: Array, other: Array, joints: Sequence[str]) -> Iterator[Change]:
    apart, unit = _apart(name, one, other)
    other_values = ~((one == other) | (np.isnan(one) & np.isnan(other)))
    # q and -q are the same rotation, but different numbers.
    differs = other_values.any(-1) if other_values.ndim > apart.ndim else other_values
    labels: Sequence[str | None] = [None]
    if name in _OF_SKELETON:
        # One value per joint, without frames.
        apart, differs, labels = apart[None], differs[None], joints
    elif one.ndim > 1 and one.shape[1] == len(joints):
        labels = joints
    elif name == "contacts":
        labels = SIDES
    else:
        apart, differs = apart.reshape(-1, 1), differs.reshape(-1, 1)
    for column, label in enumerate(labels):
        values, count = apart[:, column], int(differs[:, column].sum())
        if count:
            at = int(np.where(differs[:, column], values, -1.0).argmax())
            frame = at if len(values) > 1 else None
            yield Change(name, label, float(f"{values[at]:.4g}"), unit, frame, count)


def _apart(name: str, one: Array, other: Array) -> tuple[Array, str]:
    """Distance and its unit, one number per vector; infinite if the value is missing on one side."""
    unseen = np.isnan(one) & np.isnan(other)
    gap = np.abs(np.where(unseen, 0.0, other - one))
    gap = np.where(np.isnan(gap), np.inf, gap)
    if name in _LENGTHS:
        return 1e3 * np.sqrt(np.square(gap).sum(-1)), "mm"
    if name in _ROTATIONS:
        turned = np.abs(np.where(unseen, 0.0, other + one))
        turned = np.where(np.isnan(turned), np.inf, turned)
        nearer = np.minimum(np.sqrt(np.square(gap).sum(-1)), np.sqrt(np.square(turned).sum(-1)))
        angle = np.degrees(4.0 * np.arcsin(np.minimum(1.0, nearer / 2.0)))
        return np.where(np.isinf(nearer), np.inf, angle), "°"
    if name == "euler":
        # A full turn is not a difference.
        return np.degrees(np.minimum(gap, np.abs(gap - 2.0 * np.pi)).max(-1)), "°"
    if name in _COUNTED:
        return (gap > 0).astype(np.float64), "other"
    if name.startswith("angle."):
        return np.degrees(gap), "°"
    return gap, "s" if name == "times" else "Hz"


def read_any(path: Path) -> Canonical:
    """Canonical arrays of a file of `datasets build`, a motion.json or a clip's Parquet."""
    if path.name == "quaternions.parquet":
        return Canonical.of_clip(read_converted(path.parent))
    if path.suffix == ".parquet":
        return Canonical.of_clip(read_clip(path))
    document = read_json(path)
    found = document.get("format") if isinstance(document, dict) else None
    if found == FORMAT:
        return Canonical.read(path)
    if found == MOTION_FORMAT:
        return canonical_motion(read_motion_json(path))
    raise KinemimicError(f"{path}: expected a motion, a clip or canonical arrays, found format {found!r}")


_NAMES = (*STAGES.values(), "raw.parquet", "clip.parquet", "quaternions.parquet")


def _is_beside(part: str) -> bool:
    """Whether a folder of a run holds earlier results, recordings, exports or unfinished work, which are not
    its motion."""
    return part in ("outdated", "simulate", "export") or part.startswith((".", "session-"))


def file_pairs(before: Path, after: Path) -> Mapping[str, tuple[Path | None, Path | None]]:
    """Name -> (file before, file after) of two files or two folders; None if a folder lacks the file."""
    for path in (before, after):
        if not path.exists():
            raise KinemimicError(f"{path}: expected a file or a folder, found none")
    if before.is_file() and after.is_file():
        return {after.name: (before, after)}
    if before.is_file() or after.is_file():
        raise KinemimicError(f"expected two files or two folders, found one of each: {before}, {after}")
    there = [
        {
            str(path.relative_to(root)): path
            for name in _NAMES
            for path in sorted(root.rglob(name))
            if not any(map(_is_beside, path.relative_to(root).parts))
        }
        for root in (before, after)
    ]
    if not any(there):
        raise KinemimicError(f"{before}: expected a folder with {', '.join(_NAMES)}, found none of them")
    names = sorted(there[0].keys() | there[1].keys())
    return {name: (there[0].get(name), there[1].get(name)) for name in names}


def describe(change: Change) -> str:
    """The change in one line."""
    where = f" {change.joint}" if change.joint else ""
    if change.unit in _WHOLE:
        return change.array
    many = f", {change.frames} frames differ" if change.frames > 1 else ""
    at = f" in frame {change.frame}" if change.frame is not None else ""
    if change.unit == "other":
        return f"{change.array}{where}: other{at}{many}"
    return f"{change.array}{where}: {_amount(change)}{at}{many}"


def _amount(change: Change) -> str:
    if np.isinf(change.largest):
        return "missing on one side"
    return f"{change.largest:.4g}" + ("°" if change.unit == "°" else f" {change.unit}")


def _file_changes(before: Path, after: Path) -> dict[str, list[Change] | str]:
    found: dict[str, list[Change] | str] = {}
    pairs = file_pairs(before, after)
    for name, (one, other) in pairs.items():
        if one is None or other is None:
            found[name] = "added" if one is None else "removed"
            continue
        read = read_any(one), read_any(other)
        try:
            differing = find_changes(*read)
        except KinemimicError as error:
            if len(pairs) == 1:
                raise
            found[name] = str(error)
            continue
        if differing:
            found[name] = differing
    return found


@click.command("diff")
@click.argument("before", type=click.Path(path_type=Path))
@click.argument("after", type=click.Path(path_type=Path))
@json_option("Print every change as JSON.")
def command(before: Path, after: Path, as_json: bool) -> None:
    """List the differences from BEFORE to AFTER in terms of motion: joints, degrees, millimetres, frames.

    BEFORE and AFTER: files (motion.json, a clip's .parquet, a file of `datasets build`), folders of such
    files, for example runs, or data sets of `batch`. Numbers are rounded to 1e-5, as in a locked data set.
    Exit status 1 if anything differs.

    \b
      kinemimic datasets diff runs/before runs/after
    """
    from kinemimic.retarget.versions.dataset_diff import dataset_changes  # noqa: PLC0415 (it builds on this)

    both_are_sets = is_dataset(before) and is_dataset(after)
    found = dataset_changes(before, after) if both_are_sets else _file_changes(before, after)
    if as_json:
        click.echo(json.dumps({name: _json(change) for name, change in found.items()}, indent=2))
    elif not found:
        click.echo("no difference")
    else:
        show(*_tables(found))
    if found:
        click.get_current_context().exit(EXIT_DIFFERENT)


def _json(change: list[Change] | str) -> Any:
    if isinstance(change, str):
        return change
    return [{**asdict(one), "largest": None if np.isinf(one.largest) else one.largest} for one in change]


def _tables(found: Mapping[str, list[Change] | str]) -> Iterator[Any]:
    for name, change in found.items():
        if isinstance(change, str):
            yield f"{name}: {change}"
            continue
        yield name
        table = grid("", "", "largest", "in frame", "frames that differ", left=2)
        for one in change:
            amount = "" if one.unit in _WHOLE else "other" if one.unit == "other" else _amount(one)
            table.add_row(
                f"  {one.array}", one.joint or "", amount,
                "" if one.frame is None else str(one.frame), str(one.frames or ""),
            )  # fmt: skip
        yield table
