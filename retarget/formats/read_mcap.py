"""Reading motions from MCAP files of `write_mcap`, with recovery of damaged files."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from google.protobuf.message import DecodeError
from lz4.frame import LZ4FrameDecompressor
from mcap.exceptions import EndOfFile, InvalidMagic, McapError
from mcap.records import Channel, Chunk, McapRecord, Message, Metadata
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC
from zstandard import ZstdDecompressor, ZstdError

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.rotations import continuous
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES, SIDES
from kinemimic.retarget.formats.write_mcap import BASE_FRAME, METADATA_NAME, NODE_FRAMES
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.humanoid.motion_check import check_motion

# A frame takes 3 kB: 1 GiB holds 100 minutes at 60 Hz. Compressed data may claim any size, and a few
# kilobytes can expand to gigabytes. Our chunks have 256 KiB, those of other writers a few MiB.
MAX_BYTES = 2**30
MAX_CHUNK_BYTES = 16 * 2**20

# Errors of the libraries for damaged bytes (lz4: RuntimeError).
_DAMAGE = (
    McapError, ZstdError, DecodeError, ValueError, KeyError, IndexError, struct.error, OverflowError,
    RuntimeError,
)  # fmt: skip


@dataclass(frozen=True)
class Recovered:
    """A motion, and a description of the fault of its file: None if the file is complete."""

    motion: Motion
    fault: str | None


def read_mcap(path: Path) -> Motion:
    """The motion of an MCAP file of `write_mcap`; a cycle is read back as a cycle.

    All checksums are verified. A KinemimicError describes a truncated or damaged file and what it still
    holds.
    """
    recovered = recover_mcap(path)
    if recovered.fault is not None:
        raise KinemimicError(
            f"{path}: expected a complete MCAP, found {recovered.fault}; --recover reads the rest"
        )
    return recovered.motion


def recover_mcap(path: Path) -> Recovered:
    """The recoverable motion in an MCAP file that may be truncated or damaged.

    Uses the longest run of frames without a gap from chunks with a correct checksum. A cycle of which every
    frame is present is read back as a cycle. KinemimicError if no frame is left, or for files of other
    programs.
    """
    scan = _scan(path)
    if not scan.frames:
        where = f" in a file that is {scan.trouble}" if scan.trouble else ""
        raise KinemimicError(f"{path}: expected transforms of a motion, found none{where}")
    try:
        record = {key: json.loads(value) for key, value in scan.record.items() if key != "time"}
        first, last = _longest_run(sorted(scan.frames))
        motion = _motion(record, scan.frames, first, last)
        played = int(record["played"])
    except (*_DAMAGE, TypeError):
        raise KinemimicError(
            f"{path}: expected a file of `retarget` or `export`, found one of another program or version; "
            "write it again"
        ) from None
    motion = check_motion(path, motion)
    if scan.trouble is None and last - first == played:
        return Recovered(motion, None)
    held = f"frames {first} to {last - 1} of {played} ({(last - first) / motion.rate:.2f} s)"
    fault = f"it {scan.trouble or 'incomplete'}, with {held} in it"
    return Recovered(replace(motion, provenance={**motion.provenance, "recovered": held}), fault)


@dataclass
class _Scan:
    """record: the metadata; frames: serialised transforms by number; trouble: the first fault of the file."""

    record: dict[str, str]
    frames: dict[int, bytes]
    trouble: str | None = None


def _scan(path: Path) -> _Scan:
    scan = _Scan({}, {})
    channels: set[int] = set()
    for record in _records(path, scan):
        if isinstance(record, Metadata) and record.name == METADATA_NAME:
            scan.record = record.metadata
        elif isinstance(record, Channel) and record.topic == "/tf":
            channels.add(record.id)
        elif isinstance(record, Message) and record.channel_id in channels:
            scan.frames[record.sequence] = record.data
    return scan


def _records(path: Path, scan: _Scan) -> Iterator[McapRecord]:
    """The readable records; `scan.trouble` describes the first unreadable one."""
    if not path.is_file():
        raise KinemimicError(f"{path}: expected an MCAP file, found none")
    _check_size(path, path.stat().st_size)
    unpacked = 0
    with path.open("rb") as stream:
        if stream.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
            raise KinemimicError(f"{path}: expected an MCAP file, found something else")
        stream.seek(0)
        reader = StreamReader(stream, emit_chunks=True, validate_crcs=True)
        try:
            for record in reader.records:
                if not isinstance(record, Chunk):
                    yield record
                    continue
                try:
                    chunk = _decompressed(record)
                    unpacked += len(chunk.data)
                    _check_size(path, unpacked)
                    yield from breakup_chunk(chunk, validate_crc=True)
                except _DAMAGE:
                    scan.trouble = scan.trouble or "damaged (a checksum is wrong)"
        except (EndOfFile, InvalidMagic, struct.error):
            # Within a record, or without the magic bytes after the last one.
            scan.trouble = scan.trouble or "truncated"
        except (*_DAMAGE, MemoryError):
            scan.trouble = scan.trouble or "damaged"


def _check_size(path: Path, size: int) -> None:
    if size > MAX_BYTES:
        raise KinemimicError(f"{path}: expected an MCAP of at most {MAX_BYTES >> 20} MiB, found more data")


def _decompressed(chunk: Chunk) -> Chunk:
    """The chunk decompressed; ValueError beyond MAX_CHUNK_BYTES.

    The library itself would decompress without a bound. The size that the chunk declares is not needed: its
    checksum verifies the content.
    """
    match chunk.compression:
        case "zstd":
            data = ZstdDecompressor().stream_reader(chunk.data).read(MAX_CHUNK_BYTES + 1)
        case "lz4":
            data = LZ4FrameDecompressor().decompress(chunk.data, max_length=MAX_CHUNK_BYTES + 1)
        case _:
            data = chunk.data
    if len(data) > MAX_CHUNK_BYTES:
        raise ValueError("a chunk too large")
    return replace(chunk, compression="", data=data)


def _longest_run(numbers: list[int]) -> tuple[int, int]:
    """First number, and last plus one, of the longest run without a gap in ascending numbers."""
    stretches = np.split(np.array(numbers), np.flatnonzero(np.diff(numbers) != 1) + 1)
    longest = max(stretches, key=len)
    return int(longest[0]), int(longest[-1]) + 1


def _motion(record: dict[str, Any], frames: dict[int, bytes], first: int, last: int) -> Motion:
    """The motion of frames first to last - 1, reduced to one cycle if they contain one."""
    cyclic, length = bool(record["cyclic"]), int(record["frames"])
    if cyclic := cyclic and first == 0 and last >= length:
        last = length
    nodes = {name: NODE_INDEX[node] for node, name in NODE_FRAMES.items()}
    root = np.full((last - first, 3), np.nan)
    rotations = np.full((last - first, len(NODES), 4), np.nan)
    offsets = np.full((len(NODES), 3), np.nan)
    for row, number in enumerate(range(first, last)):
        message = FrameTransforms.FromString(frames[number])
        for link in message.transforms:
            place, turn = link.translation, link.rotation
            if link.child_frame_id == BASE_FRAME:
                # The pelvis is fixed to the base: the base's rotation is the root's.
                root[row] = place.x, place.y, place.z
                rotations[row, 0] = turn.x, turn.y, turn.z, turn.w
                continue
            node = nodes[link.child_frame_id]
            offsets[node] = place.x, place.y, place.z
            if node:
                rotations[row, node] = turn.x, turn.y, turn.z, turn.w
    if not all(np.isfinite(array).all() for array in (root, rotations, offsets)):
        raise ValueError("a frame lacks a link or its position")
    planted = np.array([record["contacts"][side] for side in SIDES], dtype=np.bool_).T
    return Motion(
        rate=float(record["fps"]),
        root=root,
        rotations=continuous(rotations),
        contacts=planted[np.arange(first, last) % length],
        cyclic=cyclic,
        cycle_offset=np.array(record["cycle_offset"], dtype=np.float64) if cyclic else np.zeros(3),
        offsets=offsets,
        provenance=record["provenance"],
    )
