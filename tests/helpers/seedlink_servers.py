"""A small SeedLink server (protocol 3) that replays miniSEED records, and drops connections."""

from __future__ import annotations

import re
import socket
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field


@dataclass
class SeedLinkServer:
    """Has `records` (sequence numbers count from 1) of one station.

    It closes a connection after `drop_after` records; `told` are the lines that it got. A client
    that names a sequence number gets that record and all after; another gets all from `live` on.
    """

    records: Sequence[bytes]
    drop_after: int | None = None
    live: int = 1
    stations: tuple[str, ...] = ("HGR3",)
    port: int = 0
    told: list[str] = field(default_factory=list)
    sent: list[int] = field(default_factory=list)
    connections: int = 0
    arrived: threading.Condition = field(default_factory=threading.Condition)

    def add(self, *records: bytes) -> None:
        """Have more records, as a digitizer that measures on."""
        with self.arrived:
            self.records = [*self.records, *records]
            self.arrived.notify_all()

    def serve(self, connection: socket.socket, ended: threading.Event) -> None:
        self.connections += 1
        following = self.live
        with connection, connection.makefile("rb") as lines:
            for line in lines:
                word = line.decode().strip()
                self.told.append(word)
                if word == "HELLO":
                    connection.sendall(b"SeedLink v3.1 (test)\r\nhere\r\n")
                elif word.startswith("STATION"):
                    known = word.split()[1] in self.stations
                    connection.sendall(b"OK\r\n" if known else b"ERROR\r\n")
                elif word.startswith("DATA"):
                    number = re.match(r"DATA ([0-9A-F]+)", word)
                    following = int(number[1], 16) if number else self.live
                    connection.sendall(b"OK\r\n")
                elif word == "END":
                    break
                elif not word.startswith("INFO"):
                    connection.sendall(b"OK\r\n")
            self._stream(connection, following, ended)

    def _stream(self, connection: socket.socket, following: int, ended: threading.Event) -> None:
        n_sent = 0
        while not ended.is_set():
            with self.arrived:
                if following > len(self.records):
                    self.arrived.wait(0.05)
                    continue
                record = self.records[following - 1]
            if self.drop_after is not None and n_sent >= self.drop_after:
                return
            connection.sendall(b"SL%06X" % following + record)
            self.sent.append(following)
            following, n_sent = following + 1, n_sent + 1


@contextmanager
def a_seedlink_server(
    records: Sequence[bytes], *, port: int = 0, drop_after: int | None = None, live: int = 1
) -> Iterator[SeedLinkServer]:
    """Listen on a port of this machine until the end of the block."""
    server, ended = SeedLinkServer(records, drop_after, live), threading.Event()
    connections: list[socket.socket] = []

    def serve(connection: socket.socket) -> None:
        with suppress(OSError):  # the client has gone
            server.serve(connection, ended)

    def accept(listener: socket.socket) -> None:
        while True:
            try:
                connection, _ = listener.accept()
            except OSError:
                return
            connections.append(connection)
            threading.Thread(target=serve, args=(connection,), daemon=True).start()

    with socket.create_server(("127.0.0.1", port)) as listener:
        server.port = listener.getsockname()[1]
        threading.Thread(target=accept, args=(listener,), daemon=True).start()
        try:
            yield server
        finally:
            ended.set()
            listener.shutdown(socket.SHUT_RDWR)
            for connection in connections:
                with suppress(OSError):
                    connection.shutdown(socket.SHUT_RDWR)
