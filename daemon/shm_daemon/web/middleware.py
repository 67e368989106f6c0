"""Wrap every request: whose Host it names, which headers protect the answer, a line in the log.

Plain ASGI: what wraps requests the comfortable way would hold uploads in memory. `/health` is
answered here, and no caller takes all places: where callers keep those of the pages taken, uploads,
sign-ins, `/metrics` and `/health` still have places of their own.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections import Counter
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from enum import StrEnum
from typing import Any

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from shm_daemon.web.address import IMPORTS, NOTES, PASSWORDS, STREAMS, UPLOADS
from shm_daemon.web.health import health_document
from shm_daemon.web.site import Site

PROTECTION = {
    # Plotly styles what it draws in place and paints grids as data: images.
    "Content-Security-Policy": "default-src 'self'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data:; base-uri 'none'; form-action 'self'; "
    "frame-ancestors 'none'; object-src 'none'",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "same-origin",  # with none at all, our own forms would be of no origin
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), geolocation=(), microphone=()",
    "Cache-Control": "no-store",
}
HTTPS_ONLY = {"Strict-Transport-Security": "max-age=31536000"}
"""For who came by HTTPS: from now on a browser comes by nothing else. No names below ours."""

log = logging.getLogger(__name__)


class HeadersMiddleware:
    """Wraps the app."""

    def __init__(self, app: ASGIApp, site: Site):
        self._app, self._site = app, site

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        began, status = time.monotonic(), 500
        protection = PROTECTION | (HTTPS_ONLY if is_https(scope) else {})

        async def protected(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                headers = MutableHeaders(scope=message)
                for name, value in protection.items():
                    headers.setdefault(name, value)
            await send(message)

        try:
            await self._answer(scope, receive, protected)
        finally:
            # Neither headers nor what stands behind the path: tokens end up in such places.
            seconds = time.monotonic() - began
            path = scope["path"].encode("ascii", "backslashreplace").decode()
            log.info("%s %.200r %d %.3f s", scope["method"], path, status, seconds)

    async def _answer(self, scope: Scope, receive: Receive, send: Send) -> None:
        host = Headers(scope=scope).get("host", "")
        if self._site.answers_to(host):
            await self._app(scope, receive, send)
            return
        headers = {
            "message": "The request is meant for another host.",
            "remedy": "Call the interface by its address, or name the host in the setting "
            "web_hosts.",
        }
        await JSONResponse(headers, 400)(scope, receive, send)


def is_https(scope: Scope) -> bool:
    """Return True if the caller came by HTTPS, to us or to a proxy before us.

    A proxy's word is enough, whoever it is: to believe it only makes cookies and browsers stricter.
    """
    forwarded = Headers(scope=scope).get("x-forwarded-proto", "").split(",")[0].strip().lower()
    return "https" in (scope["scheme"], forwarded)


HEALTH, METRICS = "/health", "/metrics"


_LONGEST_CHECK_S = 5.0  # technical: within the 10 s that Prometheus waits by default
_AGAIN_S = 5
_LONGEST_BODY_BYTES = 65_536
"""Of what is no upload: a reason for an acknowledgement has 2,000 characters at most."""


class Kind(StrEnum):
    """Kinds of requests by the resources that they may take."""

    PAGE = "pages"
    UPLOAD = "uploads"
    METRICS = "metrics"
    HASHING = "passwords"


PLACES = {Kind.PAGE: 24, Kind.UPLOAD: 12, Kind.METRICS: 3, Kind.HASHING: 60}
"""So many requests of a kind at once: together fewer than the 40 threads that answer them, but for
passwords, which wait in line for a thread of their own.
"""


class LimitMiddleware:
    """Answer `/health`, and pass on as many requests of a kind at once as have a place."""

    def __init__(self, app: ASGIApp, site: Site):
        self._app = app
        self._site = site.twin()  # the pages may keep all connections to the store busy
        self._taken: Counter[Kind] = Counter()
        self._checking: asyncio.Task[tuple[int, dict[str, Any]]] | None = None
        self._checker = ThreadPoolExecutor(1, "health")

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            self._checker.shutdown(wait=False, cancel_futures=True)
            self._site.close()
        elif scope["type"] == "http":
            await self._answer(scope, receive, send)

    async def _answer(self, scope: Scope, receive: Receive, send: Send) -> None:
        path, method = scope["path"], scope["method"]
        if path == HEALTH and method in ("GET", "HEAD"):
            status, document = await self._health()
            await JSONResponse(document, status)(scope, receive, send)
            return
        kind = Kind.METRICS if path == METRICS else Kind.PAGE
        if method == "POST" and path in PASSWORDS:
            kind = Kind.HASHING
        if is_upload(scope):
            kind = Kind.UPLOAD
        else:
            whole = await _whole(receive)
            if whole is None:
                await _fault(413, "This is more than is taken here.")(scope, receive, send)
                return
            receive = whole
        if self._taken[kind] >= PLACES[kind]:
            message = f"Too many requests at once: all places of {kind} are taken."
            await _fault(503, message, "Try again in some seconds.")(scope, receive, send)
            return
        self._taken[kind] += 1
        try:
            await self._app(scope, receive, send)
        finally:
            self._taken[kind] -= 1

    async def _health(self) -> tuple[int, dict[str, Any]]:
        """Return the state of health, shared by simultaneous callers, without a hung store."""
        if self._checking is None or self._checking.done():
            self._checking = asyncio.create_task(self._check())
        try:
            async with asyncio.timeout(_LONGEST_CHECK_S):
                return await asyncio.shield(self._checking)
        except TimeoutError:
            slow = f"The checks take more than {_LONGEST_CHECK_S:.0f} s."
            return 503, {"status": "failing", "reasons": [slow]}

    async def _check(self) -> tuple[int, dict[str, Any]]:
        loop = asyncio.get_running_loop()
        return await loop.run_in_executor(self._checker, health_document, self._site)


def is_upload(scope: Mapping[str, object]) -> bool:
    """Return True if a request may have a long body: its sender needs a token first."""
    path = str(scope["path"])
    is_chunk = path.startswith(f"{STREAMS}/") and path.endswith("/chunks")
    return scope["method"] == "POST" and (path in (UPLOADS, IMPORTS, NOTES) or is_chunk)


async def _whole(receive: Receive) -> Receive | None:
    """Return a `receive` with the complete body; None where it is too long.

    So a slow sender occupies no place.
    """
    body, message = bytearray(), await receive()
    while message["type"] == "http.request":
        body += message.get("body", b"")
        if len(body) > _LONGEST_BODY_BYTES:
            return None
        if not message.get("more_body"):
            break
        message = await receive()
    first: list[Message] = [{"type": "http.request", "body": bytes(body), "more_body": False}]
    if message["type"] != "http.request":
        first = [message]

    async def receive_limited() -> Message:
        return first.pop() if first else await receive()

    return receive_limited


def _fault(status: int, message: str, remedy: str = "") -> JSONResponse:
    headers = {"Retry-After": str(_AGAIN_S)} if status == 503 else None
    return JSONResponse({"message": message, "remedy": remedy}, status, headers)
