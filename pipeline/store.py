"""Files: atomic writes, content hashes, and clips as Parquet."""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from kinemimic.pipeline.clip import Clip
from kinemimic.pipeline.errors import CaptureError, KinemimicError
from kinemimic.pipeline.schema import upgraded
from kinemimic.pipeline.skeleton import Skeleton

CLIP_SCHEMA = 1
_ANGLE = "angle."
_PER_JOINT = {"positions": "xyz", "euler": "123", "translations": "xyz", "rotations": "xyzw"}


@contextmanager
def atomic(path: Path) -> Iterator[Path]:
    """A temporary path in the same folder; it becomes `path` when the block ends well, else it vanishes."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=path.suffix, dir=path.parent)
    os.close(handle)
    temporary = Path(name)
    umask = os.umask(0)
    os.umask(umask)
    try:
        yield temporary
        # mkstemp and safetensors make private files; a result gets the mode that any other file would have.
        temporary.chmod(0o666 & ~umask)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def copy_file(source: Path, target: Path) -> None:
    """Copy a file's content atomically."""
    with atomic(target) as temporary:
        temporary.write_bytes(source.read_bytes())


def write_text(path: Path, text: str) -> None:
    """Write a text file atomically."""
    with atomic(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_json(path: Path, value: Any) -> None:
    """Write JSON atomically, keys in the given sequence, NaN refused."""
    write_text(path, json.dumps(value, indent=2, allow_nan=False) + "\n")


def read_json(path: Path) -> Any:
    """Read a JSON file; a KinemimicError names the file if it is missing or damaged."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise KinemimicError(f"{path}: expected a file, found none; run the stage that writes it") from None
    except (ValueError, UnicodeDecodeError) as error:
        raise KinemimicError(f"{path}: expected JSON, found {error}") from None


def content_hash(arrays: Mapping[str, Any]) -> str:
    """SHA-256 over names, types, shapes and values of arrays, whatever file they came from."""
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
    """Columns as Parquet, atomically; the header is JSON under the metadata's key `kinemimic`."""
    table = pa.table(dict(columns)).replace_schema_metadata({"kinemimic": json.dumps(header)})
    with atomic(path) as temporary:
        pq.write_table(table, temporary, compression="zstd")


def write_clip(path: Path, clip: Clip) -> None:
    """A clip as Parquet: one row a frame, a column per joint and component; the rest in the metadata."""
    columns: dict[str, Any] = {"time": clip.times, "pass": clip.passes}
    for j, joint in enumerate(clip.skeleton.names):
        columns[f"{joint}.state"] = clip.states[:, j]
        for field, components in _PER_JOINT.items():
            array = getattr(clip, field)
            if array is not None:
                for k, component in enumerate(components):
                    columns[f"{joint}.{field}.{component}"] = array[:, j, k]
    for name, curve in (clip.angles or {}).items():
        columns[f"{_ANGLE}{name}"] = curve
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
        "provenance": clip.provenance,
    }
    write_table(path, columns, header)


def read_clip(path: Path) -> Clip:
    """Read a clip that `write_clip` wrote."""
    try:
        table = pq.read_table(path)
        header = json.loads((table.schema.metadata or {})[b"kinemimic"])
    except FileNotFoundError:
        raise CaptureError(path, expected="a clip", found="no file", advice="run the stage before") from None
    except (pa.ArrowInvalid, KeyError, ValueError) as error:
        raise CaptureError(
            path, expected="a kinemimic clip (Parquet)", found=str(error).splitlines()[0]
        ) from None
    if not isinstance(header, dict) or "skeleton" not in header:
        raise CaptureError(path, expected="a kinemimic clip (Parquet)", found="another table of ours")
    header = upgraded(header, path, kind="a clip", schema=CLIP_SCHEMA, advice="run `ingest` again")
    spec = header["skeleton"]
    skeleton = Skeleton(
        tuple(spec["names"]), tuple(spec["parents"]), np.array(spec["offsets"], dtype=np.float64)
    )
    present = set(table.column_names)

    def stack(field: str) -> Any:
        components = _PER_JOINT[field]
        if f"{skeleton.names[0]}.{field}.{components[0]}" not in present:
            return None
        return np.stack(
            [
                np.stack([table[f"{joint}.{field}.{c}"].to_numpy() for c in components], axis=-1)
                for joint in skeleton.names
            ],
            axis=1,
        )

    orders, rests = header["orders"], header.get("rests")
    angles = {
        name.removeprefix(_ANGLE): table[name].to_numpy()
        for name in table.column_names
        if name.startswith(_ANGLE)
    }
    return Clip(
        skeleton=skeleton,
        times=table["time"].to_numpy(),
        passes=table["pass"].to_numpy(),
        states=np.stack([table[f"{joint}.state"].to_numpy() for joint in skeleton.names], axis=1),
        orders=None if orders is None else tuple(orders),
        world_from_file=np.array(header["world_from_file"]),
        rests=None if rests is None else np.array(rests),
        provenance=header["provenance"],
        angles=angles or None,
        **{field: stack(field) for field in _PER_JOINT},
    )
