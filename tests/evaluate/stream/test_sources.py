"""Sources and what a sender can do to them: malformed, long, many, broken off."""

from __future__ import annotations

import json
import os
import socket
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from samples.walker import walker

from kinemimic.evaluate.stream import sockets
from kinemimic.evaluate.stream import source as source_module
from kinemimic.evaluate.stream.files import CaptureFile, Stdin
from kinemimic.evaluate.stream.sockets import Tcp, Udp
from kinemimic.evaluate.stream.source import (
    DROPPED,
    HOST,
    MAX_FAULT,
    MAX_FRAMES,
    MAX_READS,
    Faults,
    Lines,
    frames_of,
)
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.live.frame import MAX_LINE, CapturedFrame, decoded_frame
from kinemimic.pipeline.writers.skl import write_skl

POSITIONS = [[0.1, 0.2, 0.3]] * 20


def line(moment: float) -> bytes:
    return json.dumps({"time": moment, "positions": POSITIONS}).encode() + b"\n"


def soon(source: Udp | Tcp, count: int = 1) -> list[CapturedFrame]:
    """Frames that arrive within a second."""
    found = list[CapturedFrame]()
    for _ in range(200):
        found += source.poll(0.0)
        if len(found) >= count:
            break
        time.sleep(0.005)
    return found


@pytest.fixture
def udp() -> Iterator[Udp]:
    source = Udp(0)
    yield source
    source.close()


@pytest.fixture
def tcp() -> Iterator[Tcp]:
    source = Tcp(0)
    yield source
    source.close()


def test_udp_reads_frames_and_counts_faults(udp: Udp) -> None:
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    for text in (line(1.0), b"nonsense", b"\x00" * 60_000, line(2.0) + line(3.0)):
        sender.sendto(text, (HOST, udp.port))
    assert [frame.time for frame in soon(udp, 3)] == [1.0, 2.0, 3.0]
    assert udp.faults == Counter({"refused: no frame in JSON": 1, "refused: line too long": 1})
    sender.close()


class Flood:
    """A socket at which datagrams never cease."""

    def __init__(self) -> None:
        self.received = 0

    def getsockname(self) -> tuple[str, int]:
        return HOST, 1024

    def recv(self, size: int) -> bytes:
        self.received += 1
        return line(float(self.received))


def test_a_flood_costs_no_more_than_a_few_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    flood, decoded = Flood(), list[bytes]()

    def counted(one: bytes) -> CapturedFrame:
        decoded.append(one)
        return decoded_frame(one)

    monkeypatch.setattr(sockets, "opened", lambda kind, port: flood)
    monkeypatch.setattr(source_module, "decoded_frame", counted)
    udp = Udp(0)
    for calls in (1, 2):
        newest = range(calls * MAX_READS - MAX_FRAMES + 1, calls * MAX_READS + 1)
        assert [frame.time for frame in udp.poll(0.0)] == [float(k) for k in newest]
        assert flood.received == calls * MAX_READS
        assert len(decoded) == calls * MAX_FRAMES
        assert udp.faults == {DROPPED: calls * (MAX_READS - MAX_FRAMES)}


def test_tcp_has_one_sender_at_a_time(tcp: Tcp) -> None:
    first = socket.create_connection((HOST, tcp.port))
    first.sendall(line(1.0)[:50])
    assert tcp.poll(0.0) == []
    others = [socket.create_connection((HOST, tcp.port)) for _ in range(3)]
    first.sendall(line(1.0)[50:])
    assert [frame.time for frame in soon(tcp)] == [1.0]
    soon(tcp, 99) if tcp.faults["refused: another sender is connected"] < 1 else None
    assert tcp.faults["refused: another sender is connected"] >= 1
    first.close()
    for _ in range(50):
        tcp.poll(0.0)
        time.sleep(0.002)
    again = socket.create_connection((HOST, tcp.port))
    again.sendall(line(2.0))
    assert [frame.time for frame in soon(tcp)] == [2.0]
    for one in (again, *others):
        one.close()


def test_a_tcp_sender_that_comes_back_at_once_is_not_turned_away(tcp: Tcp) -> None:
    first = socket.create_connection((HOST, tcp.port))
    first.sendall(line(1.0))
    assert [frame.time for frame in soon(tcp)] == [1.0]
    first.sendall(line(2.0)[:-1])  # no newline, as Stdin takes it
    first.close()
    again = socket.create_connection((HOST, tcp.port))
    again.sendall(line(3.0))
    time.sleep(0.05)
    assert [frame.time for frame in soon(tcp, 2)] == [2.0, 3.0]
    assert not tcp.faults
    again.close()


def test_why_the_last_frame_was_refused_is_kept(udp: Udp) -> None:
    faults = Faults()
    assert frames_of([json.dumps({"time": 1.0, "positions": POSITIONS[:17]}).encode()] * 3, faults) == []
    assert faults.last == "expected 20, 25, 32, 33 joints in a frame, found 17"
    assert faults.refused == 3
    faults.note("refused: no OSC")
    assert (faults.last, faults.refused) == ("no OSC", 4)
    faults.note("refused: no OSC", "a\nb" * 1000)
    assert len(faults.last) == MAX_FAULT
    assert "\n" not in faults.last


def test_a_taken_port_is_one_line(udp: Udp) -> None:
    with pytest.raises(KinemimicError, match="in use"):
        Udp(udp.port)


def test_nothing_listens_beyond_this_machine(udp: Udp, tcp: Tcp) -> None:
    for name in (udp.name, tcp.name):
        assert "127.0.0.1" in name


def test_lines_are_bounded_in_length_and_memory() -> None:
    faults = Faults()
    lines = Lines(faults)
    assert lines.take(b"a\nb") == [b"a"]
    assert lines.take(b"c\n\n") == [b"bc"]
    for _ in range(100):
        assert lines.take(b"x" * MAX_LINE) == []
    assert len(lines._rest) <= MAX_LINE
    assert faults["refused: line too long"] == 1
    assert lines.take(b"rest of it\nnext\n") == [b"next"]


def test_only_the_newest_frames_of_a_step_count() -> None:
    faults = Faults()
    found = frames_of([line(float(k)) for k in range(50)], faults)
    assert [frame.time for frame in found] == [float(k) for k in range(50 - MAX_FRAMES, 50)]
    assert faults["dropped: too many at once"] == 50 - MAX_FRAMES


def test_standard_input_ends() -> None:
    read, write = os.pipe()
    source = Stdin(read)
    assert source.poll(0.0) == []
    os.write(write, line(1.0) + line(2.0)[:-1])
    assert [frame.time for frame in source.poll(0.0)] == [1.0]
    os.write(write, b"\n")
    os.close(write)
    assert [frame.time for frame in source.poll(0.0)] == [2.0]
    assert source.ended
    os.close(read)


def test_the_last_line_of_standard_input_needs_no_newline() -> None:
    read, write = os.pipe()
    source = Stdin(read)
    os.write(write, line(1.0) + line(2.0)[:-1])
    os.close(write)
    assert [frame.time for frame in source.poll(0.0)] == [1.0, 2.0]
    assert source.ended
    os.close(read)


def test_standard_input_without_lines_is_read_in_bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    zero, reads = os.open("/dev/zero", os.O_RDONLY), iter(range(1000))

    def counted(_: int, size: int) -> bytes:
        next(reads)
        return bytes(size)

    monkeypatch.setattr(os, "read", counted)
    source = Stdin(zero)
    assert source.poll(0.0) == []
    assert not source.ended
    assert source.faults == {"refused: line too long": 1}
    os.close(zero)


def test_a_replay_keeps_its_clock(tmp_path: Path) -> None:
    clip = walker(rate=30.0).clip
    milliseconds = np.rint(1000.0 * clip.times).astype(np.int64)
    write_skl(
        tmp_path / "walk.skl", milliseconds, clip.positions, clip.states, np.array([0.0, 1.0, 0.0, 0.9])
    )
    source = CaptureFile(tmp_path / "walk.skl")
    found = list[CapturedFrame]()
    for k in range(200):
        found += source.poll(k / 30.0)
        assert all(frame.time <= k / 30.0 + 1e-9 for frame in found)
    assert np.isclose(found[-1].time, source.seconds, atol=0.04)
    assert source.ended
    source.rewind()
    again = [*source.poll(7.0), *source.poll(7.0 + source.seconds)]
    assert [frame.time for frame in again] == pytest.approx(7.0 + np.array([frame.time for frame in found]))
    assert [frame.positions for frame in again] == [frame.positions for frame in found]
    assert source.count == 2 * len(found)
