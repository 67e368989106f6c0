"""HTTP servers of a test's own, which note what they are told and answer as they are told."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer


@dataclass(frozen=True)
class Told:
    """One request."""

    path: str
    headers: dict[str, str]
    body: bytes


@dataclass(frozen=True)
class Answer:
    """What to answer; `cut` ends the connection instead, without a word."""

    status: int = 200
    body: bytes = b""
    headers: tuple[tuple[str, str], ...] = ()
    cut: bool = False


@dataclass
class Listener:
    """An HTTP server at `url`; `answer` may be exchanged while it runs."""

    url: str = ""
    told: list[Told] = field(default_factory=list)
    answer: Callable[[Told], Answer] = lambda told: Answer()


@contextmanager
def a_listener(answer: Callable[[Told], Answer] | None = None) -> Iterator[Listener]:
    """Listens on a free port of this machine until the end of the block."""
    listener = Listener()
    if answer is not None:
        listener.answer = answer

    class Handler(BaseHTTPRequestHandler):
        timeout = 5

        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
            told = Told(self.path, dict(self.headers), body)
            listener.told.append(told)
            given = listener.answer(told)
            if given.cut:
                self.close_connection = True
                return
            self.send_response(given.status)
            for name, value in given.headers:
                self.send_header(name, value)
            self.send_header("Content-Length", str(len(given.body)))
            self.end_headers()
            self.wfile.write(given.body)

        do_GET = do_POST  # noqa: N815 (the name that http.server looks up)

        def log_message(self, *_: object) -> None:
            return

    class Server(ThreadingHTTPServer):
        daemon_threads = True

        def handle_error(self, *_: object) -> None:
            return  # a client that was killed

    with Server(("127.0.0.1", 0), Handler) as server:
        listener.url = f"http://127.0.0.1:{server.server_port}/alerts"
        threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
        try:
            yield listener
        finally:
            server.shutdown()


@contextmanager
def a_silent_listener(drip: bytes = b"", every_s: float = 0.1) -> Iterator[str]:
    """The address of a server that takes connections and never answers; or byte by byte."""
    ended = threading.Event()

    def serve(connection: socket.socket) -> None:
        with connection:
            for number in range(10_000):
                if ended.wait(every_s):
                    return
                if drip:
                    try:
                        connection.sendall(drip[number % len(drip) :][:1])
                    except OSError:
                        return

    def accept(server: socket.socket) -> None:
        while True:
            try:
                connection, _ = server.accept()
            except OSError:
                return
            threading.Thread(target=serve, args=(connection,), daemon=True).start()

    with socket.create_server(("127.0.0.1", 0)) as server:
        threading.Thread(target=accept, args=(server,), daemon=True).start()
        try:
            yield f"http://127.0.0.1:{server.getsockname()[1]}/"
        finally:
            ended.set()
            server.shutdown(socket.SHUT_RDWR)
