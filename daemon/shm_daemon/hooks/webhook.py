"""A hook that is an address: the alert is posted to it as JSON, signed with a shared secret.

The signature is over the time and the body, so that who listens can refuse what is forged, and what
is old. It is made as most services make theirs: HMAC with SHA-256 (RFC 2104, Krawczyk 1997).

Requests that can be broken off: the library's own time limit holds for one read, not for all.
"""

from __future__ import annotations

import hashlib
import hmac
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http import HTTPStatus
from typing import Any

import requests
from requests.adapters import HTTPAdapter

from shm.bridge import WebhookHook
from shm.documents import dump
from shm.pipeline import DeliveryRefused
from shm.values import Alert
from shm_daemon.hooks.contract import SHOWN_CHARACTERS, DeliveryContext, HookFailed, one_line

_WORTH_ANOTHER_TRY = (
    HTTPStatus.REQUEST_TIMEOUT,
    HTTPStatus.TOO_EARLY,
    HTTPStatus.TOO_MANY_REQUESTS,
)
_LOOK = "See that its server runs, then try `shm alerts test`."


class WebhookDeliverer:
    """Posts each alert; an answer of 200 to 299 says that it is delivered."""

    def __init__(self, surroundings: DeliveryContext):
        self._surroundings = surroundings
        self._lines = Lines()

    def __call__(self, hook: WebhookHook, alert: Alert) -> str:
        """Posts the alert; raises HookFailed, or DeliveryRefused where the server wants none."""
        body = dump(self._surroundings.document(alert)).encode()
        headers = _headers(alert, body, self._secret(hook), int(time.time()))
        timeout_s = self._surroundings.timeout_s
        with self._lines.session(timeout_s) as (session, line):
            try:
                with session.post(
                    hook.url,
                    data=body,
                    headers=headers,
                    timeout=timeout_s,
                    allow_redirects=False,
                    stream=True,
                    auth=unchanged,
                ) as response:
                    return _judged(response)
            except (requests.RequestException, OSError) as error:
                # Not `from error`: its words hold the whole address, and that may be a key.
                raise self._failure(hook, line, error) from None

    def ready(self, hook: WebhookHook) -> str:
        """The machine that is told; raises HookFailed where the secret is missing."""
        self._secret(hook)
        return hook.host

    def close(self) -> None:
        self._lines.close()

    def _secret(self, hook: WebhookHook) -> bytes:
        if hook.secret_env:
            secret = self._surroundings.environment.get(hook.secret_env, "").encode()
            where = f"the variable {hook.secret_env} of the environment"
        else:
            secret, where = self._secret_of_file(hook), hook.secret_file
        if not secret:
            raise HookFailed(
                f"{where} holds no secret.", remedy="Put one there; see docs/alerts.md."
            )
        return secret

    def _secret_of_file(self, hook: WebhookHook) -> bytes:
        try:
            return (self._surroundings.folder / hook.secret_file).read_bytes().strip()
        except OSError as error:
            raise HookFailed(
                f"the secret in {hook.secret_file} cannot be read: {error.strerror}.",
                remedy="Write it, readable for the user that runs the daemon; see docs/alerts.md.",
            ) from None

    def _failure(self, hook: WebhookHook, line: Line, error: Exception) -> HookFailed:
        if self._lines.closed:
            return HookFailed("broken off: the daemon is ending.")
        if line.cut_off or isinstance(error, requests.Timeout):
            limit = f"{self._surroundings.timeout_s:g} s"
            return HookFailed(f"no answer of {hook.host} within {limit}.", remedy=_LOOK)
        if isinstance(error, requests.exceptions.SSLError):
            return HookFailed(
                f"{hook.host} cannot show that it is who it says ({reason_of(error)}).",
                remedy="Have its certificate mended.",
            )
        return HookFailed(f"{hook.host} cannot be reached ({reason_of(error)}).", remedy=_LOOK)


def signature(secret: bytes, timestamp: str, body: bytes) -> str:
    """Return what stands in X-Shm-Signature: who listens makes it again and compares."""
    made = hmac.new(secret, timestamp.encode() + b"." + body, hashlib.sha256)
    return f"sha256={made.hexdigest()}"


def _headers(alert: Alert, body: bytes, secret: bytes, unix_s: int) -> dict[str, str]:
    return {
        "Content-Type": "application/json",
        "User-Agent": "shm",
        "Idempotency-Key": alert.key.encode("ascii", "backslashreplace").decode(),
        "X-Shm-Timestamp": str(unix_s),
        "X-Shm-Signature": signature(secret, str(unix_s), body),
    }


def _judged(response: requests.Response) -> str:
    """Return what the server answered, if it took the alert.

    Raises HookFailed or DeliveryRefused.
    """
    status = response.status_code
    if 200 <= status < 300:
        return f"{status} {one_line(response.reason or '')}".strip()
    try:  # the beginning of its own words; its answer counts even where they break off
        words = next(response.iter_content(SHOWN_CHARACTERS), b"").decode(errors="replace")
    except (requests.RequestException, OSError):
        words = ""
    answer = (
        f"answered {status}: {one_line(words) or one_line(response.reason or '') or 'no message'}"
    )
    if 300 <= status < 400:
        raise HookFailed(answer, remedy="Write the address that it sends to; it is not followed.")
    if 400 <= status < 500 and status not in _WORTH_ANOTHER_TRY:
        raise DeliveryRefused(answer, remedy="Correct its address or its secret.")
    raise HookFailed(answer, remedy=_LOOK)


def unchanged(request: requests.PreparedRequest) -> requests.PreparedRequest:
    """Keeps the library from adding a password of the user's own (`.netrc`) to the request."""
    return request


def reason_of(error: BaseException) -> str:
    """The innermost cause in the operating system's words, without the address."""
    reason, cause = type(error).__name__, error.__cause__ or error.__context__
    seen: set[int] = set()
    while cause is not None and id(cause) not in seen:
        seen.add(id(cause))
        if isinstance(cause, OSError) and cause.strerror:
            reason = cause.strerror
        cause = cause.__cause__ or cause.__context__
    return one_line(reason)


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
