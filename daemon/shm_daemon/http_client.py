"""HTTP requests with a deadline for all of a request; a library's limit holds for one read.

A request runs in a thread of its own. At its deadline, or once the client is closed, it is left to
itself: its answer counts no more, and the thread ends with the connection.
"""

from __future__ import annotations

import threading
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import requests

from shm.errors import ShmError
from shm_daemon.hooks.contract import one_line

_PIECE_BYTES = 4096  # technical


class NoAnswer(ShmError):
    """A server could not be reached, gave no answer in time, or the client was closed.

    `reason` has no address in it, which may be a key.
    """

    def __init__(self, reason: str, *, is_late: bool = False, is_untrusted: bool = False):
        super().__init__(reason)
        self.reason, self.is_late, self.is_untrusted = reason, is_late, is_untrusted


@dataclass(frozen=True)
class Answer:
    """The answer of a server: the beginning of its body, and whether there was more."""

    status: int
    reason: str
    body: bytes
    is_cut: bool


class HttpClient:
    """Send requests; `close` ends from another thread those under way, and begins no more."""

    def __init__(self) -> None:
        self._pending: set[Future[Answer]] = set()
        self._lock = threading.Lock()
        self.closed = False

    def send(
        self, method: str, url: str, timeout_s: float, most_bytes: int, **options: Any
    ) -> Answer:
        """Return an answer, redirects not followed; raises NoAnswer."""
        future: Future[Answer] = Future()
        with self._lock:
            if self.closed:
                raise _broken_off()
            self._pending.add(future)
        options = {"timeout": timeout_s, "allow_redirects": False, "auth": _unchanged} | options
        arguments = future, method, url, most_bytes, options
        threading.Thread(target=_work, args=arguments, name="http", daemon=True).start()
        try:
            return future.result(timeout_s)
        except (TimeoutError, requests.Timeout):
            raise NoAnswer(f"no answer within {timeout_s:g} s", is_late=True) from None
        except requests.exceptions.SSLError as error:
            raise NoAnswer(reason_of(error), is_untrusted=True) from None
        except (requests.RequestException, OSError) as error:
            # Not `from error`: its words hold the whole address.
            raise NoAnswer(reason_of(error)) from None
        finally:
            with self._lock:
                self._pending.discard(future)

    def close(self) -> None:
        with self._lock:
            self.closed = True
            for future in self._pending:
                with suppress(InvalidStateError):
                    future.set_exception(_broken_off())


def _work(
    future: Future[Answer], method: str, url: str, most_bytes: int, options: dict[str, Any]
) -> None:
    try:
        answer = _exchange(method, url, most_bytes, options)
    except BaseException as error:  # noqa: BLE001 - whoever waits is told
        with suppress(InvalidStateError):
            future.set_exception(error)
    else:
        with suppress(InvalidStateError):
            future.set_result(answer)


def _exchange(method: str, url: str, most_bytes: int, options: dict[str, Any]) -> Answer:
    with (
        requests.Session() as session,
        session.request(method, url, stream=True, **options) as response,
    ):
        body, is_taken = bytearray(), method == "POST" and 200 <= response.status_code < 300
        # What was taken is taken, whatever becomes of the words that follow.
        for piece in () if is_taken else response.iter_content(min(most_bytes, _PIECE_BYTES)):
            body += piece
            if len(body) > most_bytes:
                break
        is_cut = len(body) > most_bytes
        reason = one_line(response.reason or "")
        return Answer(response.status_code, reason, bytes(body[:most_bytes]), is_cut)


def _unchanged(request: requests.PreparedRequest) -> requests.PreparedRequest:
    """Keep the library from adding a password of the user's own (`.netrc`) to the request."""
    return request


def _broken_off() -> NoAnswer:
    return NoAnswer("broken off: the daemon is ending")


def reason_of(error: BaseException) -> str:
    """Return the innermost cause in the operating system's words, without the address."""
    reason, cause = type(error).__name__, error.__cause__ or error.__context__
    seen: set[int] = set()
    while cause is not None and id(cause) not in seen:
        seen.add(id(cause))
        if isinstance(cause, OSError) and cause.strerror:
            reason = cause.strerror
        cause = cause.__cause__ or cause.__context__
    return one_line(reason)
