"""Reading MCAP: an exact round trip, and recovery of damaged files."""

from __future__ import annotations

import struct
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.reader import NonSeekingReader
from mcap.writer import Writer

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.rotations import continuous, normalize
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.retarget.formats import read_mcap as mcap_reader
from kinemimic.retarget.formats import write_mcap as mcap_writer
from kinemimic.retarget.formats.read_mcap import MAX_CHUNK_BYTES, read_mcap, recover_mcap
from kinemimic.retarget.formats.write_mcap import write_mcap
from kinemimic.retarget.humanoid.motion import Motion

FRAMES = 400


def motion(frames: int = FRAMES, *, cyclic: bool = False) -> Motion:
    random = np.random.default_rng(3)
    turns = np.array([0.0, 0.0, 0.0, 1.0]) + 0.3 * random.normal(size=(frames, len(NODES), 4))
    return Motion(
        rate=59.5,
        root=random.normal(size=(frames, 3)),
        rotations=continuous(normalize(turns)),
        contacts=random.random((frames, 2)) > 0.5,
        cyclic=cyclic,
        cycle_offset=np.array([1.3, 0.0, 0.0]) * cyclic,
        provenance={"source": "a.skl", "simulated": True},
    )


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("mcap") / "motion.mcap"
    write_mcap(path, motion())
    return path


@pytest.fixture(scope="module")
def cycle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("mcap") / "cycle.mcap"
    write_mcap(path, motion(50, cyclic=True))
    return path


def cut(path: Path, size: int, folder: Path) -> Path:
    short = folder / "cut.mcap"
    short.write_bytes(path.read_bytes()[:size])
    return short


def transforms(path: Path) -> int:
    """Number of /tf messages that the library's own reader finds in a truncated file."""
    count = 0
    with path.open("rb") as stream:
        try:
            for _, channel, _ in NonSeekingReader(stream, validate_crcs=True).iter_messages(
                log_time_order=False
            ):
                count += channel.topic == "/tf"
        except Exception:
            return count
    return count


@pytest.mark.parametrize("cyclic", [False, True])
def test_a_motion_survives_a_round_trip(whole: Path, cycle: Path, cyclic: bool) -> None:
    before = motion(50, cyclic=True) if cyclic else motion()
    after = read_mcap(cycle if cyclic else whole)
    assert after.identity == before.identity
    np.testing.assert_array_equal(after.contacts, before.contacts)
    assert after.provenance == before.provenance
    assert recover_mcap(cycle if cyclic else whole).fault is None


@pytest.mark.parametrize("share", [0.3, 0.5, 0.8, 0.999])
def test_a_truncated_file_is_reported_and_recovered(whole: Path, tmp_path: Path, share: float) -> None:
    short = cut(whole, int(share * whole.stat().st_size), tmp_path)
    there = transforms(short)
    assert 0 < there <= FRAMES
    held = rf"found it truncated, with frames 0 to {there - 1} of 400"
    message = rf"expected a complete MCAP, {held} .*--recover"
    with pytest.raises(KinemimicError, match=message) as caught:
        read_mcap(short)
    assert "\n" not in str(caught.value) and "cut.mcap" in str(caught.value)
    found = recover_mcap(short)
    assert found.fault is not None
    before = motion()
    np.testing.assert_array_equal(found.motion.root, before.root[:there])
    np.testing.assert_array_equal(found.motion.rotations, before.rotations[:there])
    np.testing.assert_array_equal(found.motion.contacts, before.contacts[:there])
    assert found.motion.provenance["source"] == "a.skl"
    assert found.motion.provenance["recovered"].startswith(f"frames 0 to {there - 1} of 400")


def test_a_cycle_is_complete_without_its_later_repetitions(cycle: Path, tmp_path: Path) -> None:
    short = cut(cycle, cycle.stat().st_size // 2, tmp_path)
    found = recover_mcap(short)
    assert found.fault is not None and found.motion.cyclic
    assert found.motion.identity == motion(50, cyclic=True).identity


def test_a_wrong_byte_is_detected_and_the_longest_run_recovered(whole: Path, tmp_path: Path) -> None:
    data = bytearray(whole.read_bytes())
    data[len(data) // 3] ^= 4
    damaged = tmp_path / "damaged.mcap"
    damaged.write_bytes(data)
    with pytest.raises(KinemimicError, match=r"damaged \(a checksum is wrong\), with frames .*--recover"):
        read_mcap(damaged)
    left = recover_mcap(damaged).motion
    assert 100 < len(left.root) < FRAMES
    first = int(np.flatnonzero((motion().root == left.root[0]).all(axis=1))[0])
    np.testing.assert_array_equal(left.root, motion().root[first : first + len(left.root)])
    np.testing.assert_array_equal(left.contacts, motion().contacts[first : first + len(left.root)])


def test_lost_or_wrong_bytes_never_cause_a_traceback(cycle: Path, tmp_path: Path) -> None:
    random, data = np.random.default_rng(0), cycle.read_bytes()
    path = tmp_path / "damaged.mcap"
    for trial in range(60):
        broken = bytearray(data)
        if trial % 2:
            broken = broken[: int(random.integers(len(data)))]
        else:
            # The first kilobyte holds the schemas and the record, the last ones the index.
            at = int(random.integers(1000) if trial % 4 else random.integers(len(data)))
            broken[at] ^= 1 << int(random.integers(8))
        path.write_bytes(broken)
        for read in (read_mcap, recover_mcap):
            try:
                read(path)
            except KinemimicError as error:
                assert "\n" not in str(error)


def with_chunk(path: Path, folder: Path, *, size: int, compression: bytes, packed: bytes) -> Path:
    """A copy with one more chunk, without a checksum, before the first."""
    body = struct.pack("<QQQI", 0, 1, size, 0)
    for part, form in ((compression, "<I"), (packed, "<Q")):
        body += struct.pack(form, len(part)) + part
    data, at = path.read_bytes(), 8
    while data[at] != Opcode.CHUNK:
        at += 9 + struct.unpack_from("<Q", data, at + 1)[0]
    record = bytes([Opcode.CHUNK]) + struct.pack("<Q", len(body)) + body
    (folder / "chunk.mcap").write_bytes(data[:at] + record + data[at:])
    return folder / "chunk.mcap"


@pytest.mark.parametrize("claimed", [10, MAX_CHUNK_BYTES + 1])
@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_a_chunk_that_expands_beyond_the_limit_is_damage(
    cycle: Path, tmp_path: Path, compression: str, claimed: int
) -> None:
    zeros = bytes(MAX_CHUNK_BYTES + 1)
    packed = zstandard.compress(zeros) if compression == "zstd" else lz4.frame.compress(zeros)
    assert len(packed) < 100_000
    bomb = with_chunk(cycle, tmp_path, size=claimed, compression=compression.encode(), packed=packed)
    # Found without a checksum, and what else there is stays whole.
    found = recover_mcap(bomb)
    assert found.fault is not None and "damaged" in found.fault
    assert found.motion.identity == motion(50, cyclic=True).identity


def test_all_chunks_together_expand_at_most_to_the_limit(
    cycle: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mcap_reader, "MAX_BYTES", 2**20)
    zeros = bytes(2**20 + 1)
    bomb = with_chunk(cycle, tmp_path, size=len(zeros), compression=b"zstd", packed=zstandard.compress(zeros))
    with pytest.raises(KinemimicError, match=r"expected an MCAP of at most 1 MiB, found more data"):
        recover_mcap(bomb)


@pytest.mark.parametrize("compression", [b"lz4", b"zstd", b"bzip", b"\xff\xfe"])
def test_a_chunk_that_is_not_of_its_declared_compression_is_damage(
    cycle: Path, tmp_path: Path, compression: bytes
) -> None:
    path = with_chunk(cycle, tmp_path, size=100, compression=compression, packed=b"junk")
    with pytest.raises(KinemimicError, match="damaged"):
        read_mcap(path)


@pytest.mark.parametrize(
    ("key", "value", "told"),
    [
        ("fps", "0", "fps: expected 1 to 1000 frames a second, found 0"),
        ("fps", "NaN", "fps: expected 1 to 1000 frames a second, found nan"),
        ("fps", "1e300", "fps: expected 1 to 1000 frames a second"),
        ("fps", "1" + 400 * "0", "one of another program or version"),
        ("provenance", "[]", "provenance: expected a table"),
        ("provenance", '"x"', "provenance: expected a table"),
        ("provenance", '{"x": NaN}', "provenance: expected plain JSON"),
        (
            "provenance",
            '{"capture": "x"}',
            "provenance.capture: expected a table of source and sha256, found 'x'",
        ),
        ("provenance", 100_000 * "[", "one of another program or version"),
        ("cycle_offset", "[NaN, 0, 0]", "cycle_offset: expected less than 10,000 m, found nan"),
        ("cycle_offset", "[1]", "cycle_offset: expected 3 numbers"),
        ("cycle_offset", '"x"', "one of another program or version"),
    ],
)
def test_metadata_out_of_bounds_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, key: str, value: str, told: str
) -> None:
    original = mcap_writer._metadata
    monkeypatch.setattr(mcap_writer, "_metadata", lambda *told: original(*told) | {key: value})
    write_mcap(tmp_path / "odd.mcap", motion(5, cyclic=True))
    for read in (read_mcap, recover_mcap):
        with pytest.raises(KinemimicError, match=told) as caught:
            read(tmp_path / "odd.mcap")
        assert "\n" not in str(caught.value)


def test_files_of_other_programs_are_refused(tmp_path: Path) -> None:
    with pytest.raises(KinemimicError, match="expected an MCAP file, found none"):
        read_mcap(tmp_path / "none.mcap")
    (tmp_path / "text.mcap").write_text("a text that is no MCAP")
    with pytest.raises(KinemimicError, match="expected an MCAP file, found something else"):
        recover_mcap(tmp_path / "text.mcap")
    with (tmp_path / "other.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        channel = writer.register_channel("/tf", "json", writer.register_schema("a", "jsonschema", b"{}"))
        writer.add_message(channel, 0, b"{}", 0)
        writer.finish()  # type: ignore[no-untyped-call]
    with pytest.raises(KinemimicError, match="found one of another program or version"):
        read_mcap(tmp_path / "other.mcap")


def test_frames_without_a_link_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    links = {node: name for node, name in mcap_writer.NODE_FRAMES.items() if node != "foot_left"}
    monkeypatch.setattr(mcap_writer, "NODE_FRAMES", links)
    write_mcap(tmp_path / "lame.mcap", motion(5))
    monkeypatch.undo()
    for read in (read_mcap, recover_mcap):
        with pytest.raises(KinemimicError, match="found one of another program or version"):
            read(tmp_path / "lame.mcap")
