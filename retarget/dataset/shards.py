"""The frames of many motions in Parquet files of bounded size, and one motion of these."""

from __future__ import annotations

import json
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.files.validation.tables import numbers
from kinemimic.pipeline.kinematics.rotations import normalize
from kinemimic.pipeline.kinematics.skeleton import NODES, SIDES
from kinemimic.retarget.dataset.columns import DATASET_SCHEMA, FRAME_COLUMNS, MOTIONS, schema_of
from kinemimic.retarget.humanoid.body import node_offsets
from kinemimic.retarget.humanoid.motion import Motion, joint_angles

# About 40 MB. A motion is in one shard only; a longer one has a shard of its own.
FRAMES_PER_SHARD = 250_000
_FRAMES_PER_GROUP = 16_384  # what a reader holds at once
_WIDTH = 4 * len(NODES)


class ShardWriter:
    """Writes the motions of one split into FOLDER/motions/SPLIT-NNNNN.parquet; memory is that of a row group.

    The same motions in the same order give the same bytes.
    """

    def __init__(self, folder: Path, split: str, *, most: int = FRAMES_PER_SHARD) -> None:
        self._folder, self._split, self._most = folder, split, most
        self._schema = schema_of(FRAME_COLUMNS).with_metadata(_metadata())
        self._number = 0
        self._waiting: list[pa.Table] = []
        self._frames = 0  # in this shard
        self._open: tuple[pq.ParquetWriter, BinaryIO] | None = None

    def add(self, name: str, subject: str, kind: str, motion: Motion) -> str:
        """Write a motion; returns its shard's path in the folder."""
        table = _frames(name, subject, kind, motion, self._schema)
        if self._frames and self._frames + len(table) > self._most:
            self.close()
            self._number += 1
        self._frames += len(table)
        self._waiting.append(table)
        if sum(map(len, self._waiting)) >= _FRAMES_PER_GROUP:
            self._flush()
        return self._path

    @property
    def _path(self) -> str:
        return f"{MOTIONS}/{self._split}-{self._number:05d}.parquet"

    def close(self) -> None:
        """Finish the shard that is being written, if any."""
        self._flush()
        if self._open is not None:
            writer, stream = self._open
            writer.close()
            stream.close()
            self._open = None
        self._frames = 0

    def _flush(self) -> None:
        if not self._waiting:
            return
        if self._open is None:
            path = self._folder / self._path
            path.parent.mkdir(parents=True, exist_ok=True)
            stream = path.open("wb")
            encoded = {"compression": "zstd", "use_dictionary": ["motion", "subject", "kind"]}
            self._open = (pq.ParquetWriter(stream, self._schema, **encoded), stream)
        table = pa.concat_tables(self._waiting)
        self._open[0].write_table(table, row_group_size=_FRAMES_PER_GROUP)
        self._waiting = []


def read_motion(
    folder: Path, shard: str, name: str, *, rate: float, cyclic: bool, cycle_offset: Array, simulated: bool
) -> Motion:
    """A motion of a data set; the keywords are in its row of the index. CaptureError if it is not there."""
    path = folder / shard
    kind, advice = "a shard of a data set", "make the data set again"
    try:
        table = pq.read_table(path, filters=[("motion", "==", name)])
        root, rotations = (
            _lists(table, column, width) for column, width in (("root_m", 3), ("rotations_xyzw", _WIDTH))
        )
        contacts = np.stack([numbers(table, f"contact_{side}", "b") for side in SIDES], axis=1)
        return Motion(
            rate=rate,
            root=root,
            rotations=normalize(rotations.reshape(-1, len(NODES), 4)),
            contacts=contacts,
            cyclic=cyclic,
            cycle_offset=cycle_offset,
            provenance={"simulated": simulated},
        )
    except FileNotFoundError:
        raise CaptureError(path, expected=kind, found="no file", advice=advice) from None
    except (pa.ArrowException, OSError, ValueError, KeyError) as error:
        raise CaptureError(
            path, expected=f"the motion {name}", found=str(error)[:160], advice=advice
        ) from None


def _lists(table: pa.Table, name: str, width: int) -> Array:
    column = table[name].combine_chunks()
    values = np.asarray(column.flatten(), dtype=np.float64)
    if not len(table) or len(values) != len(table) * width:
        raise ValueError(f"{len(values)} numbers in {len(table)} frames of {name}")
    return values.reshape(-1, width)


def _frames(name: str, subject: str, kind: str, motion: Motion, schema: pa.Schema) -> pa.Table:
    count = len(motion.root)
    frames = np.arange(count, dtype=np.int32)
    columns = {
        "motion": pa.array([name] * count),
        "subject": pa.array([subject] * count),
        "kind": pa.array([kind] * count),
        "frame": frames,
        "time_s": (frames / motion.rate).astype(np.float32),
        "root_m": _packed(motion.root),
        "rotations_xyzw": _packed(motion.rotations.reshape(count, -1)),
        "contact_left": motion.contacts[:, 0].astype(bool),
        "contact_right": motion.contacts[:, 1].astype(bool),
        **{f"{angle}_deg": _degrees(curve) for angle, curve in joint_angles(motion.rotations).items()},
    }
    return pa.table({field.name: columns[field.name] for field in schema}, schema=schema)


def _packed(values: Array) -> pa.Array:
    offsets = np.arange(len(values) + 1, dtype=np.int32) * values.shape[1]
    return pa.ListArray.from_arrays(offsets, pa.array(values.astype(np.float32).ravel()))


def _degrees(curve: Array) -> Array:
    return np.degrees(curve).astype(np.float32)


def _metadata() -> dict[str, str]:
    return {
        "kinemimic": json.dumps({"schema": DATASET_SCHEMA, "table": "frames of motions"}),
        "kinemimic.nodes": json.dumps(list(NODES)),
        "kinemimic.offsets_m": json.dumps(node_offsets().tolist()),
    }
