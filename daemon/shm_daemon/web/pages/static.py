"""Style sheets and scripts. They tell nothing of the bridge: anybody may have them.

Plotly's script is that of the installed package: nothing is fetched from elsewhere.
"""

from __future__ import annotations

import gzip
from functools import cache
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from fastapi import APIRouter, Request, Response

from shm.report.as_html import ENVIRONMENT
from shm_daemon.web.faults import Refused
from shm_daemon.web.frame import STATIC, asset

router = APIRouter(prefix="/static", include_in_schema=False)

_KINDS = {".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
_KEPT = "public, max-age=31536000, immutable"
_ASKED_AGAIN = "no-cache"
_WORTH_PACKING_BYTES = 1000  # technical: less goes into one packet (1,460 bytes) anyhow


@router.get("/plotly.js")
def plotly(request: Request) -> Response:
    """The script that draws figures, under an address that changes with its version."""
    return _answer(request, "plotly.js", request.query_params.get("v") == version("plotly"))


@router.get("/{name}")
def static(request: Request, name: str) -> Response:
    """A file of ours."""
    if name != "report.css" and name not in {path.name for path in STATIC.iterdir()}:
        raise Refused(404, f"There is no {name}.")
    is_of_version = name != "report.css" and asset(name).endswith(f"?{request.url.query}")
    return _answer(request, name, is_of_version)


def _answer(request: Request, name: str, is_of_version: bool) -> Response:
    packs = "gzip" in request.headers.get("accept-encoding", "")
    content, packed = _content(name), b""
    headers = {
        "Cache-Control": _KEPT if is_of_version else _ASKED_AGAIN,
        "Vary": "Accept-Encoding",
    }
    if packs and len(content) > _WORTH_PACKING_BYTES:
        packed, headers["Content-Encoding"] = _packed(name), "gzip"
    return Response(packed or content, headers=headers, media_type=_KINDS[Path(name).suffix])


@cache
def _packed(name: str) -> bytes:
    return gzip.compress(_content(name), 6, mtime=0)


@cache
def _content(name: str) -> bytes:
    if name == "plotly.js":
        return _plotly().read_bytes()
    if name == "report.css":
        assert ENVIRONMENT.loader is not None
        return ENVIRONMENT.loader.get_source(ENVIRONMENT, name)[0].encode()
    return (STATIC / name).read_bytes()


def _plotly() -> Path:
    """Found without importing the package, which takes seconds."""
    found = find_spec("plotly")
    if found is None or found.origin is None:
        raise Refused(404, "plotly is not installed.", "pip install 'shm[web]'")
    return Path(found.origin).parent / "package_data" / "plotly.min.js"
