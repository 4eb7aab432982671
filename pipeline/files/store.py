"""Atomic writes, content hashes, JSON files, and clips as Parquet."""

from __future__ import annotations

import glob
import hashlib
import json
import os
import re
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError, KinemimicError
from kinemimic.pipeline.files.clip_table import (
    PACKED,
    RECORDED_ANGLES,
    clip_blocks,
    clip_schema,
    encoding,
    facts,
    metadata,
    rotation_blocks,
    rotation_schema,
)
from kinemimic.pipeline.files.stages import writer_of
from kinemimic.pipeline.files.validation.bounded import MEGABYTE, read_bounded
from kinemimic.pipeline.files.validation.schema import upgraded
from kinemimic.pipeline.files.validation.strict_json import strict_json
from kinemimic.pipeline.files.validation.tables import lists, numbers, open_table
from kinemimic.pipeline.kinematics.clip import Clip, Label
from kinemimic.pipeline.kinematics.rotations import ORDERS
from kinemimic.pipeline.kinematics.skeleton import Skeleton

CLIP_SCHEMA = 3
# Bytes. The largest file is a motion of 1.1 kB per frame: an hour at 60 Hz fits.
JSON_LIMIT = 256 * MEGABYTE
_CLIP, _CLIP_ADVICE = "a kinemimic clip (Parquet)", "run the stage that writes it again"
_ROTATIONS, _ROTATIONS_ADVICE = "rotations of `convert` (Parquet)", "run `convert` again"
_UNIT = 1e-3  # tolerance of a unit quaternion's length


@contextmanager
def atomic(path: Path) -> Iterator[Path]:
    """A temporary path in the same folder, renamed to `path` if the block succeeds, else deleted.

    OSError names `path` if the temporary file could not be created, written or renamed.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    prefix = f".{path.name}."
    temporary: Path | None = None
    umask = os.umask(0)
    os.umask(umask)
    try:
        handle, name = tempfile.mkstemp(prefix=prefix, suffix=path.suffix, dir=path.parent)
        os.close(handle)
        temporary = Path(name)
        yield temporary
        # mkstemp and safetensors create private files; a result gets the usual mode.
        temporary.chmod(0o666 & ~umask)
        temporary.replace(path)
    except OSError as error:
        # The error of a full disk names no file, and the temporary name would mean nothing to the user.
        ours = error.filename is None or Path(os.fsdecode(error.filename)).name.startswith(prefix)
        if error.errno is None or not ours:
            raise
        raise OSError(error.errno, error.strerror, str(path)) from None
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def remove_leftovers(path: Path) -> None:
    """Delete the temporary files that a killed `atomic(path)` left; nobody else may be writing `path`."""
    # What mkstemp adds has eight characters.
    name = re.compile(re.escape(f".{path.name}.") + "[a-z0-9_]{8}" + re.escape(path.suffix))
    for rest in path.parent.glob(glob.escape(f".{path.name}.") + "*"):
        if name.fullmatch(rest.name):
            rest.unlink(missing_ok=True)


def copy_file(source: Path, target: Path) -> None:
    """Copy a file's content atomically."""
    with atomic(target) as temporary:
        temporary.write_bytes(source.read_bytes())


def write_text(path: Path, text: str) -> None:
    """Write a text file atomically."""
    with atomic(path) as temporary:
        # The text may contain the name of a folder that is not UTF-8.
        temporary.write_text(text, encoding="utf-8", errors="backslashreplace")


def write_json(path: Path, value: Any) -> None:
    """Write JSON atomically with keys in the given order; NaN is refused."""
    write_text(path, json.dumps(value, indent=2, allow_nan=False) + "\n")


def read_json(path: Path) -> Any:
    """Read a JSON file of at most 256 MB; KinemimicError if it is missing or damaged."""
    try:
        text = read_bounded(path, JSON_LIMIT, "a JSON file").decode("utf-8")
        value = strict_json(text)
        if "\\ud" in text or "\\uD" in text:
            # Half of a character cannot be written or printed.
            json.dumps(value, ensure_ascii=False).encode()
        return value
    except FileNotFoundError:
        stage = writer_of(path.name)
        advice = f"; run `kinemimic {stage}` first" if stage else ""
        raise KinemimicError(f"{path}: expected a file, found none{advice}") from None
    except UnicodeError:
        raise KinemimicError(f"{path}: expected JSON, found bytes that are not UTF-8") from None
    except ValueError as error:
        raise KinemimicError(f"{path}: expected JSON, found {error}") from None


def content_hash(arrays: Mapping[str, Any]) -> str:
    """SHA-256 of the names, types, shapes and values of arrays."""
    digest = hashlib.sha256()
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name}:{array.dtype.str}:{array.shape};".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


def file_hash(path: Path) -> str:
    """SHA-256 of a file's bytes."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def write_table(path: Path, columns: Mapping[str, Any], header: Mapping[str, Any]) -> None:
    """Write columns as Parquet, atomically; the header is JSON under the metadata key `kinemimic`."""
    table = pa.table(dict(columns)).replace_schema_metadata({"kinemimic": json.dumps(header)})
    # An open file: pyarrow refuses paths that are not UTF-8, and hides the OSError of a full disk.
    with atomic(path) as temporary, temporary.open("wb") as stream:
        pq.write_table(table, stream, compression="zstd")


def write_clip(path: Path, clip: Clip) -> None:
    """Write a clip as Parquet: a row per frame, with the columns of `clip_table`."""
    header = {
        "schema": CLIP_SCHEMA,
        "skeleton": {
            "names": clip.skeleton.names,
            "parents": clip.skeleton.parents,
            "offsets": clip.skeleton.offsets.tolist(),
        },
        "orders": clip.orders,
        "world_from_file": clip.world_from_file.tolist(),
        "rests": None if clip.rests is None else clip.rests.tolist(),
        "angles": list(clip.angles or {}),
        "labels": [asdict(label) for label in clip.labels],
        "provenance": clip.provenance,
    }
    _write_blocks(path, clip_schema(), clip_blocks(clip), metadata(facts(clip), header))


@dataclass(frozen=True)
class Rotations:
    """What `convert` adds to a clip.

    names: of the joints that rotate; joints: (T, J, 4) their rotations, None if the clip has them already;
    provenance: of the converted clip.
    """

    names: tuple[str, ...]
    joints: Array | None
    provenance: Mapping[str, Any]


def write_rotations(path: Path, clip: Clip, added: Rotations, nodes: Array) -> None:
    """Write what `convert` adds to a clip, and the rotations (T, 20, 4) of the nodes for people to read."""
    header = {"schema": CLIP_SCHEMA, "rotations": added.names, "provenance": added.provenance}
    blocks = rotation_blocks(clip, nodes, added.joints)
    _write_blocks(path, rotation_schema(), blocks, metadata(facts(clip), header))


def _write_blocks(
    path: Path, schema: pa.Schema, blocks: Iterable[pa.Table], key_values: Mapping[str, str]
) -> None:
    schema = schema.with_metadata(key_values)
    with (
        atomic(path) as temporary,
        temporary.open("wb") as stream,
        pq.ParquetWriter(stream, schema, **encoding(schema)) as writer,
    ):
        for block in blocks:
            writer.write_table(block)


def read_clip(path: Path) -> Clip:
    """Read a clip of `write_clip`; CaptureError if it is missing, damaged or another file."""
    try:
        with open_table(path, kind=_CLIP, advice=_CLIP_ADVICE) as (file, header):
            if not isinstance(header, dict) or "skeleton" not in header:
                raise ValueError("another table")
            upgraded(header, path, kind="a clip", schema=CLIP_SCHEMA, advice="run `ingest` again")
            return _clip(file, header)
    except FileNotFoundError:
        raise _missing(path, "a clip") from None


def _missing(path: Path, kind: str) -> CaptureError:
    stage = writer_of(path.name)
    advice = f"run `kinemimic {stage}` first" if stage else None
    return CaptureError(path, expected=kind, found="no file", advice=advice)


def read_rotations(path: Path) -> Rotations:
    """Read a file of `write_rotations`; CaptureError if it is missing, damaged or another file."""
    try:
        with open_table(path, kind=_ROTATIONS, advice=_ROTATIONS_ADVICE) as (file, header):
            if not isinstance(header, dict) or "rotations" not in header:
                raise ValueError("another table")
            upgraded(header, path, kind="rotations", schema=CLIP_SCHEMA, advice="run `convert` again")
            name, width = PACKED["rotations"]
            names, made = tuple(map(str, header["rotations"])), _provenance(header)
            joints = lists(file, name, len(names) * width)
            return Rotations(names, None if joints is None else joints.reshape(len(joints), -1, width), made)
    except FileNotFoundError:
        raise _missing(path, "rotations") from None


def _clip(file: pq.ParquetFile, header: Mapping[str, Any]) -> Clip:
    """The clip; KeyError for a missing key of the header, other errors for invalid values."""
    skeleton = _skeleton(header["skeleton"])
    orders, rests, world = header["orders"], header.get("rests"), np.array(header["world_from_file"])
    if orders is not None and (
        len(orders) != len(skeleton.names) or any(order not in ("", *ORDERS) for order in orders)
    ):
        raise ValueError(f"the Euler orders {orders!r}")
    if world.shape != (4,) or not abs(np.linalg.norm(world) - 1.0) < _UNIT:
        raise ValueError(f"{header['world_from_file']!r} for a rotation from the file's axes")
    table = file.read(columns=["time_s", "pass"], use_threads=False)
    times = numbers(table, "time_s")
    if not len(times) or not np.isfinite(times).all():
        raise ValueError("no frames" if not len(times) else "times that are not finite")
    fields: dict[str, Any] = {}
    for field, (name, width) in PACKED.items():
        kinds, shape = ("iu", ()) if field == "states" else ("f", (width,))
        values = lists(file, name, len(skeleton.names) * width, kinds)
        fields[field] = None if values is None else values.reshape(len(times), -1, *shape)
    for field in ("positions", "states"):
        if fields[field] is None:
            raise ValueError(f"no {field}")
    named = header["angles"]
    curves = lists(file, RECORDED_ANGLES, len(named)) if named else None
    return Clip(
        skeleton=skeleton,
        times=times,
        passes=numbers(table, "pass", "iu"),
        orders=None if orders is None else tuple(orders),
        world_from_file=world,
        rests=None if rests is None else np.array(rests, dtype=np.float64),
        provenance=_provenance(header),
        angles=None if curves is None else dict(zip(named, curves.T, strict=True)),
        labels=tuple(_label(one) for one in header.get("labels", [])),
        **fields,
    )


def _provenance(header: Mapping[str, Any]) -> dict[str, Any]:
    provenance = header["provenance"]
    if not isinstance(provenance, dict):
        raise ValueError(f"the provenance {provenance!r}")
    json.dumps(provenance, allow_nan=False)  # later stages write it again
    return provenance


def _label(spec: Any) -> Label:
    try:
        return Label(str(spec["name"]), float(spec["start"]), float(spec["end"]))
    except (TypeError, KeyError):
        raise ValueError(f"the label {spec!r:.80}") from None


def _skeleton(spec: Mapping[str, Any]) -> Skeleton:
    names, parents = spec["names"], spec["parents"]
    if not names or not all(isinstance(name, str) for name in names):
        raise ValueError("a skeleton without names")
    if not all(type(parent) is int and parent >= -1 for parent in parents):
        raise ValueError("a skeleton with invalid parents")
    return Skeleton(tuple(names), tuple(parents), np.array(spec["offsets"], dtype=np.float64))
