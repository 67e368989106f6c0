"""Requests that can be broken off: the library's own time limit holds for one read, not for all."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import requests
from requests.adapters import HTTPAdapter


class Line:
    """The connections of one request, which may be cut from any other thread."""

    def __init__(self) -> None:
        self.cut_off = False
        self._sockets: list[socket.socket] = []
        self._lock = threading.Lock()

    def add(self, connection: socket.socket) -> None:
        """Takes a connection that was just made; cuts it at once where the line is cut."""
        # A second handle to the connection: encryption takes the first one over.
        handle = connection.dup()
        with self._lock:
            self._sockets.append(handle)
        if self.cut_off:
            _shut(handle)

    def cut(self) -> None:
        """Ends all connections; who waits on one of them gets an error."""
        self.cut_off = True
        with self._lock:
            for handle in self._sockets:
                _shut(handle)

    def close(self) -> None:
        with self._lock:
            while self._sockets:
                self._sockets.pop().close()


class Lines:
    """All lines in use."""

    def __init__(self) -> None:
        self._open: set[Line] = set()
        self._lock = threading.Lock()
        self.closed = False

    @contextmanager
    def session(self, timeout_s: float) -> Iterator[tuple[requests.Session, Line]]:
        """A session whose requests together take no longer than `timeout_s`."""
        line = Line()
        timer = threading.Timer(timeout_s, line.cut)
        timer.daemon = True
        with self._lock:
            self._open.add(line)
            if self.closed:
                line.cut()
        timer.start()
        try:
            with requests.Session() as session:
                for scheme in ("https://", "http://"):
                    session.mount(scheme, _CuttableAdapter(line))
                yield session, line
        finally:
            timer.cancel()
            with self._lock:
                self._open.discard(line)
            line.close()

    def close(self) -> None:
        """Cuts all lines, and those to come."""
        with self._lock:
            self.closed = True
            for line in self._open:
                line.cut()


class _CuttableAdapter(HTTPAdapter):
    def __init__(self, line: Line):
        self._line = line
        super().__init__()

    def get_connection_with_tls_context(self, *arguments: Any, **named: Any) -> Any:
        """The pool of the request, whose connections report to the line."""
        pool: Any = super().get_connection_with_tls_context(*arguments, **named)
        made = pool.ConnectionCls
        if not issubclass(made, _Reporting):
            pool.ConnectionCls = type("Reporting", (_Reporting, made), {"line": self._line})
        return pool


class _Reporting:
    """Tells a line of each connection that is made."""

    line: Line

    def _new_conn(self) -> socket.socket:
        connection: socket.socket = super()._new_conn()  # type: ignore[misc]
        self.line.add(connection)
        return connection


def _shut(handle: socket.socket) -> None:
    try:
        handle.shutdown(socket.SHUT_RDWR)
    except OSError:
        return  # the other end was quicker
