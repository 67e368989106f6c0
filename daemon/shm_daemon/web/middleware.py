"""Around every request: whose Host it names, which headers protect the answer, a line in the log.

Plain ASGI: what wraps requests the comfortable way would hold uploads in memory.
"""

from __future__ import annotations

import logging
import time

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

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


class Around:
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
        said = {
            "message": "The request is meant for another host.",
            "remedy": "Call the interface by its address, or name the host in the setting "
            "web_hosts.",
        }
        await JSONResponse(said, 400)(scope, receive, send)


def is_https(scope: Scope) -> bool:
    """Whether the caller came by HTTPS, to us or to a proxy before us.

    A proxy's word is enough, whoever it is: to believe it only makes cookies and browsers stricter.
    """
    forwarded = Headers(scope=scope).get("x-forwarded-proto", "").split(",")[0].strip().lower()
    return "https" in (scope["scheme"], forwarded)
