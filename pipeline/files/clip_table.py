"""Clips as tables with one schema for every sensor, so that recordings of different sensors concatenate.

Columns for people: time, pass, and the position and state of the 20 nodes and the knees' and hips' angles,
with units in the names; single precision, null where missing. Columns for the next stage: the arrays of the
clip on its own joints, one list per frame, double precision; null if the clip has no such array. The names of
the joints are in the metadata. Lists of one type keep the schema the same for 20 and for 38 joints, and are
as fast and as small as a column per joint.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.angles import ANGLES, leg_angles
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.orientation.rest_pose import recorded_knees
from kinemimic.pipeline.kinematics.skeleton import NODES

# Field of a clip -> its column, and the numbers per joint.
PACKED: Mapping[str, tuple[str, int]] = {
    "positions": ("joints_position_m", 3),
    "states": ("joints_state", 1),
    "euler": ("joints_euler_rad", 3),
    "translations": ("joints_translation_m", 3),
    "rotations": ("joints_rotation_xyzw", 4),
}
RECORDED_ANGLES = "recorded_angles_rad"
UNITS = (
    "_m metres, _s seconds, _deg degrees, _rad radians; x forward, y left, z up; "
    "state 0 missing, 1 inferred, 2 tracked"
)
BLOCK = 1 << 16  # rows written at a time
_WHICH = ("recording", "recording_id", "sensor", "simulated")
_ID_LENGTH = 12
_DOUBLES, _BYTES = pa.list_(pa.float64()), pa.list_(pa.uint8())


def facts(clip: Clip) -> dict[str, Any]:
    """What a table says about its recording, as JSON values: in its metadata and in pandas' attrs."""
    made = clip.provenance
    sha256 = str(made.get("sha256", ""))
    return {
        "recording": str(made.get("source", "")),
        "recording_id": sha256[:_ID_LENGTH],
        "sha256": sha256,
        "format": str(made.get("format", "")),
        "sensor": str(made.get("sensor", "")),
        "simulated": clip.simulated,
        "frames": len(clip.times),
        "rate_hz": round(clip.rate, 6),
        "units": UNITS,
        "joints": list(clip.skeleton.names),
    }


def metadata(about: Mapping[str, Any], header: Mapping[str, Any]) -> dict[str, str]:
    """The key-values of the schema: the header as JSON for us, each fact under its name, pandas' attrs."""
    plain = {
        f"kinemimic.{name}": value if isinstance(value, str) else json.dumps(value)
        for name, value in about.items()
    }
    return {"kinemimic": json.dumps(header), **plain, "PANDAS_ATTRS": json.dumps(dict(about))}


def clip_schema() -> pa.Schema:
    """The columns of raw.parquet and clip.parquet."""
    nodes = [
        column
        for node in NODES
        for column in (*(_single(f"{node}_{axis}_m") for axis in "xyz"), (f"{node}_state", pa.uint8()))
    ]
    packed = [(name, _BYTES if field == "states" else _DOUBLES) for field, (name, _) in PACKED.items()]
    angles = [_single(f"{name}_deg") for name in ANGLES]
    return pa.schema([*_row_fields(), *nodes, *angles, *packed, (RECORDED_ANGLES, _DOUBLES)])


def rotation_schema() -> pa.Schema:
    """The columns of quaternions.parquet."""
    nodes = [_single(f"{node}_q{axis}") for node in NODES for axis in "xyzw"]
    return pa.schema([*_row_fields(), *nodes, (PACKED["rotations"][0], _DOUBLES)])


def clip_blocks(clip: Clip) -> Iterator[pa.Table]:
    """The rows of a clip, at most BLOCK at a time."""
    schema, about = clip_schema(), facts(clip)
    positions, states, angles = _on_nodes(clip)
    curves = None if not clip.angles else np.stack(list(clip.angles.values()), axis=1)
    for rows in _blocks(len(clip.times)):
        columns = _row_columns(clip, about, rows)
        for k, node in enumerate(NODES):
            for axis in range(3):
                columns[f"{node}_{'xyz'[axis]}_m"] = _nullable(positions[rows, k, axis])
            columns[f"{node}_state"] = states[rows, k]
        for name in ANGLES:
            columns[f"{name}_deg"] = _nullable(np.degrees(angles[name][rows]))
        for field, (name, _) in PACKED.items():
            columns[name] = _lists(getattr(clip, field), rows, schema.field(name).type)
        columns[RECORDED_ANGLES] = _lists(curves, rows, _DOUBLES)
        yield _table(columns, schema)


def rotation_blocks(clip: Clip, nodes: Array, joints: Array | None) -> Iterator[pa.Table]:
    """The rows of a clip's rotations; nodes: (T, 20, 4); joints: (T, J, 4), None if the clip has them."""
    schema, about = rotation_schema(), facts(clip)
    for rows in _blocks(len(clip.times)):
        columns = _row_columns(clip, about, rows)
        for k, node in enumerate(NODES):
            for axis in range(4):
                columns[f"{node}_q{'xyzw'[axis]}"] = _nullable(nodes[rows, k, axis])
        columns[PACKED["rotations"][0]] = _lists(joints, rows, _DOUBLES)
        yield _table(columns, schema)


def encoding(schema: pa.Schema) -> dict[str, Any]:
    """How pyarrow writes the columns: bytes of floats by significance, which zstd packs a fifth smaller."""
    floats = [field.name for field in schema if pa.types.is_floating(field.type)]
    lists = [f"{field.name}.list.element" for field in schema if field.type == _DOUBLES]
    words = [field.name for field in schema if pa.types.is_string(field.type)]
    return {"compression": "zstd", "use_dictionary": words, "use_byte_stream_split": [*floats, *lists]}


def _table(columns: dict[str, Any], schema: pa.Schema) -> pa.Table:
    count = len(columns["time_s"])
    whole = {
        name: pa.nulls(count, schema.field(name).type) if one is None else one
        for name, one in columns.items()
    }
    return pa.table(whole, schema=schema)


def _single(name: str) -> tuple[str, pa.DataType]:
    return name, pa.float32()


def _row_fields() -> list[tuple[str, pa.DataType]]:
    which = [(name, pa.bool_() if name == "simulated" else pa.string()) for name in _WHICH]
    return [*which, ("time_s", pa.float64()), ("pass", pa.int32())]


def _row_columns(clip: Clip, about: Mapping[str, Any], rows: slice) -> dict[str, Any]:
    times = clip.times[rows]
    which = {name: pa.repeat(pa.scalar(about[name]), len(times)) for name in _WHICH}
    return {**which, "time_s": times, "pass": clip.passes[rows]}


def _on_nodes(clip: Clip) -> tuple[Array, NDArray[np.uint8], Mapping[str, Array]]:
    """Positions (T, 20, 3) and states (T, 20) of the nodes, and the legs' angles (T,) in radians; all missing
    for a clip whose joints are not a body's."""
    try:
        positions, states = to_nodes(clip)
    except KinemimicError:
        positions = np.full((len(clip.times), len(NODES), 3), np.nan)
        states = np.zeros(positions.shape[:2], dtype=np.uint8)
    return positions, states, leg_angles(positions, times=clip.times, knees=recorded_knees(clip))


def _blocks(frames: int) -> Iterator[slice]:
    yield from (slice(start, start + BLOCK) for start in range(0, frames, BLOCK))


def _nullable(values: Array) -> pa.Array:
    return pa.array(values.astype(np.float32), from_pandas=True)


def _lists(array: NDArray[Any] | None, rows: slice, kind: pa.DataType) -> pa.Array | None:
    """A list of all numbers for each row of an array (T, ...); nulls without an array."""
    if array is None:
        return None
    values = np.ascontiguousarray(array[rows])
    width = values[0].size
    ends = pa.array(np.arange(0, values.size + 1, width, dtype=np.int32))
    return pa.ListArray.from_arrays(ends, pa.array(values.reshape(-1)), type=kind)
