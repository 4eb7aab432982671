"""Frames over UDP and TCP on this machine, without threads: sockets that never wait."""

from __future__ import annotations

import socket
from collections import deque
from collections.abc import Sequence

from kinemimic.evaluate.stream.source import (
    BLOCK,
    DROPPED,
    HOST,
    MAX_BLOCKS,
    MAX_FRAMES,
    MAX_READS,
    Faults,
    Lines,
    frames_of,
)
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.live.frame import CapturedFrame

_TURNED_AWAY = 8  # connections in a control step


def opened(kind: socket.SocketKind, port: int) -> socket.socket:
    """A socket bound to a port of 127.0.0.1 that never waits; KinemimicError if the port is taken."""
    found = socket.socket(socket.AF_INET, kind)
    try:
        if kind is socket.SOCK_STREAM:
            found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        found.bind((HOST, port))
    except OSError as error:
        found.close()
        raise KinemimicError(
            f"stream: expected a free port, found {HOST}:{port} in use ({error.strerror}); choose another"
        ) from None
    found.setblocking(False)
    return found


class Datagrams:
    """Datagrams of a port of 127.0.0.1, the newest last."""

    def __init__(self, port: int, faults: Faults) -> None:
        self._socket, self._faults = opened(socket.SOCK_DGRAM, port), faults
        self.port = int(self._socket.getsockname()[1])

    def read(self, most: int, without: bytes | None = None) -> list[bytes]:
        """The newest `most` of what waits, without what begins with `without`; of a flood, the kernel drops
        what is not read here."""
        newest: deque[bytes] = deque(maxlen=most)
        read = 0
        for _ in range(MAX_READS):
            try:
                found = self._socket.recv(BLOCK)
            except BlockingIOError:
                break
            if without is None or not found.startswith(without):
                newest.append(found)
                read += 1
        if read > most:
            self._faults[DROPPED] += read - most
        return list(newest)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


class Udp:
    """A frame, or lines of frames, in each datagram."""

    waits = False

    def __init__(self, port: int) -> None:
        self.faults = Faults()
        self._datagrams = Datagrams(port, self.faults)
        self.port = self._datagrams.port
        self.name = f"UDP, {HOST}:{self.port}"

    def poll(self, elapsed: float) -> Sequence[CapturedFrame]:
        found = self._datagrams.read(MAX_FRAMES)
        lines = [line for datagram in found for line in datagram.split(b"\n") if line.strip()]
        return frames_of(lines, self.faults)

    @property
    def ended(self) -> bool:
        return False

    def close(self) -> None:
        self._datagrams.close()


class Tcp:
    """Lines of one sender at a time; others are turned away until it leaves."""

    waits = False

    def __init__(self, port: int) -> None:
        self.faults = Faults()
        self._server = opened(socket.SOCK_STREAM, port)
        self._server.listen(16)
        self.port = int(self._server.getsockname()[1])
        self.name = f"TCP, {HOST}:{self.port}"
        self._sender: socket.socket | None = None
        self._lines = Lines(self.faults)

    def poll(self, elapsed: float) -> Sequence[CapturedFrame]:
        lines: deque[bytes] = deque(maxlen=4 * MAX_FRAMES)
        read = 0
        for _ in range(MAX_BLOCKS):
            sender = self._sender or self._accepted()
            if sender is None:
                break
            try:
                block = sender.recv(BLOCK)
            except BlockingIOError:
                # Not before it is sure that the sender has not left: it may be back already.
                self._turn_others_away()
                break
            except OSError:
                block = b""
            if not block:
                self._leave()
            found = self._lines.take(block) if block else self._lines.end()
            read += len(found)
            lines.extend(found)
        if read > len(lines):
            self.faults[DROPPED] += read - len(lines)
        return frames_of(list(lines), self.faults)

    def _accepted(self) -> socket.socket | None:
        """The next sender, if one waits."""
        try:
            sender, _ = self._server.accept()
        except OSError:
            return None
        sender.setblocking(False)
        self._sender, self._lines = sender, Lines(self.faults)
        return sender

    def _turn_others_away(self) -> None:
        for _ in range(_TURNED_AWAY):
            try:
                sender, _ = self._server.accept()
            except OSError:
                return
            self.faults.note("refused: another sender is connected")
            sender.close()

    def _leave(self) -> None:
        if self._sender is not None:
            self._sender.close()
            self._sender = None

    @property
    def ended(self) -> bool:
        return False

    def close(self) -> None:
        self._leave()
        self._server.close()
