"""Render the frame of every page: templates, navigation, error pages, style sheets and scripts.

Style sheets and scripts say nothing of the bridge: they need no access. Plotly's script is that of
the installed package: nothing is fetched from elsewhere.
"""

from __future__ import annotations

import gzip
import hashlib
from functools import cache
from importlib.metadata import PackageNotFoundError
from importlib.metadata import version as version_of
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from fastapi import APIRouter, Request, Response
from fastapi.responses import HTMLResponse
from jinja2 import ChoiceLoader, Environment, PackageLoader, PrefixLoader

import shm
from shm.errors import NothingThere, ShmError
from shm.report import formatting
from shm.report.as_html import ENVIRONMENT as OF_REPORTS
from shm.report.as_html import environment
from shm.report.figures.style import PALETTE
from shm.store.alerts import count_alerts
from shm_daemon.web.commands import set_reader, with_links, without_commands
from shm_daemon.web.health import notices
from shm_daemon.web.site import Site

router = APIRouter(include_in_schema=False)

STATIC = Path(__file__).with_name("static")
"""Our style sheets and scripts."""
_KINDS = {".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
_CACHED = "public, max-age=31536000, immutable"
_ASKED_AGAIN = "no-cache"
_WORTH_PACKING_BYTES = 1000  # technical: less goes into one packet (1,460 bytes) anyhow


NAVIGATION = (
    ("/", "Bridge"),
    ("/compare", "Compare"),
    ("/alerts", "Alerts"),
    ("/streams", "Sensors"),
    ("/upload", "Upload"),
    ("/operation", "Operation"),
)

FOR_ENGINEERS = (("/settings", "Settings"), ("/users", "Users"), ("/audit", "Audit log"))


def page(request: Request, template: str, *, status: int = 200, **content: Any) -> HTMLResponse:
    """Return a page in the frame; `content` is what its template needs.

    Whoever may read sees the navigation, a stranger none: `access.reading` notes who asks.
    """
    visitor = getattr(request.state, "visitor", None)
    site = request.app.state.site
    assert isinstance(site, Site)
    number = request.path_params.get("hanger_id", "")
    hanger = int(number) if str(number).isdecimal() else None
    set_reader(hanger, is_engineer=visitor is not None and visitor.is_engineer)
    text = _environment().get_template(template).render(
        visitor=visitor,
        bridge=site.workspace.bridge.name if visitor else "",
        has_others=bool(site.workspace.bridge.other_bridges),
        open_alerts=_open_alerts(site) if visitor else None,
        here=request.url.path,
        notices=notices(site) if visitor else (),
        single_sign_on=site.workspace.bridge.single_sign_on,
        **content,
    )  # fmt: skip
    return HTMLResponse(text, status)


def prepare_templates() -> None:
    """Read all pages' templates, so that no visitor waits for it."""
    templates = _environment()
    for name in templates.list_templates(extensions=["j2"]):
        templates.get_template(name)


def problem(
    request: Request, status: int, message: str, remedy: str, headers: dict[str, str] | None
) -> HTMLResponse:
    """Show an error to a person; a stranger is asked to sign in."""
    template = "sign_in.html.j2" if status == 401 else "problem.html.j2"
    found = page(
        request, template, status=status, message=message, remedy=remedy, next=_address(request)
    )
    found.headers.update(headers or {})
    return found


def for_a_person(request: Request) -> bool:
    """Return True if a page was requested, not a document: errors have the same format."""
    path, accepted = request.url.path, request.headers.get("accept", "")
    return "text/html" in accepted and not path.startswith("/api/")


@cache
def asset(name: str) -> str:
    """Return the cacheable address of a file of `static/`, which changes with the file."""
    return f"/static/{name}?v={hashlib.sha256((STATIC / name).read_bytes()).hexdigest()[:12]}"


@cache
def plotly_address() -> str:
    """Return the address of plotly's script, of the version that is installed."""
    try:
        return f"/static/plotly.js?v={version_of('plotly')}"
    except PackageNotFoundError:
        return "/static/plotly.js"


@cache
def _environment() -> Environment:
    """Return the environment of our templates; those of the reports are under `report/`."""
    assert OF_REPORTS.loader is not None
    of_reports = PrefixLoader({"report": OF_REPORTS.loader})
    made = environment(ChoiceLoader([PackageLoader("shm_daemon.web", "templates"), of_reports]))
    made.filters.update(with_code=with_links, without_commands=without_commands)
    made.globals.update(
        asset=asset,
        moment=formatting.moment,
        navigation=NAVIGATION,
        for_engineers=FOR_ENGINEERS,
        plotly_address=plotly_address,
        palette=" ".join(f"{name}={colour}" for name, colour in PALETTE.items()),
        version=shm.__version__,
    )
    return made


def _open_alerts(site: Site) -> int | None:
    """Return the number of open alerts; None where the store fails, as the page itself says so."""
    try:
        return count_alerts(site.store)[0]
    except ShmError:
        return None


def _address(request: Request) -> str:
    """Return the address that a person asked for."""
    query = f"?{request.url.query}" if request.url.query else ""
    return request.url.path + query if request.method == "GET" else "/"


@router.get("/static/plotly.js")
def plotly(request: Request) -> Response:
    """Return the script that draws figures, under an address that changes with its version."""
    return _answer(request, "plotly.js", request.query_params.get("v") == version_of("plotly"))


@router.get("/static/{name}")
def static_file(request: Request, name: str) -> Response:
    """Return a file of ours."""
    if name != "report.css" and name not in {path.name for path in STATIC.iterdir()}:
        raise NothingThere(f"There is no {name}.")
    is_of_version = name != "report.css" and asset(name).endswith(f"?{request.url.query}")
    return _answer(request, name, is_of_version)


def _answer(request: Request, name: str, is_of_version: bool) -> Response:
    packs = "gzip" in request.headers.get("accept-encoding", "")
    content, packed = _content(name), b""
    caching = _CACHED if is_of_version else _ASKED_AGAIN
    headers = {"Cache-Control": caching, "Vary": "Accept-Encoding"}
    if packs and len(content) > _WORTH_PACKING_BYTES:
        packed, headers["Content-Encoding"] = _packed(name), "gzip"
    return Response(packed or content, headers=headers, media_type=_KINDS[Path(name).suffix])


@cache
def _packed(name: str) -> bytes:
    return gzip.compress(_content(name), 6, mtime=0)


@cache
def _content(name: str) -> bytes:
    if name == "plotly.js":
        found = find_spec("plotly")  # importing the package takes seconds
        if found is None or found.origin is None:
            raise NothingThere("plotly is not installed.", remedy="pip install 'shm[web]'")
        return (Path(found.origin).parent / "package_data" / "plotly.min.js").read_bytes()
    if name == "report.css":
        assert OF_REPORTS.loader is not None
        return OF_REPORTS.loader.get_source(OF_REPORTS, name)[0].encode()
    return (STATIC / name).read_bytes()
