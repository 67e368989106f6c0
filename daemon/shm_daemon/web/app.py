"""Put the web interface together."""

from __future__ import annotations

import gc
import logging
import threading
from collections import Counter
from collections.abc import AsyncIterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager

from fastapi import APIRouter, FastAPI, Request
from fastapi.responses import JSONResponse

import shm
from shm.errors import ShmError
from shm.pipeline import utc_now
from shm_daemon.web import frame, hangers, metrics, recordings, tests
from shm_daemon.web.access import Reader
from shm_daemon.web.background_work import BackgroundWorker
from shm_daemon.web.bridge_view import summarize_hangers
from shm_daemon.web.faults import answers, handle_faults
from shm_daemon.web.metrics import Exposition
from shm_daemon.web.other_bridges import OtherBridges
from shm_daemon.web.pages import (
    alerts,
    baseline,
    bridge,
    comparison,
    diagnosis,
    hanger,
    notes,
    one_test,
    operation,
    sensors,
    settings,
    signing_in,
    upload,
    users,
)
from shm_daemon.web.site import Site

_described = APIRouter(include_in_schema=False)

_PARTS = (
    recordings,
    upload,
    hangers,
    alerts,
    signing_in,
    users,
    frame,
    bridge,
    comparison,
    operation,
    sensors,
    tests,
    one_test,
    hanger,
    baseline,
    diagnosis,
    notes,
    settings,
)
"""What answers, asked in this order."""

_DESCRIPTION = (
    "Recordings come in, states and alerts are read, alerts are acknowledged. Answers that are no "
    "result are `{message, remedy}`. Forces in N, times in UTC."
)


def make_pages(site: Site, *, warms_up: bool = False) -> FastAPI:
    """Return all of the interface: pages, API and metrics."""
    watching_site = site.twin()  # so that a scrape need not wait for the pages' connections

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        if warms_up:
            threading.Thread(target=warm_up, args=(app,), daemon=True).start()
        yield
        app.state.background_worker.close()
        app.state.other_bridges.close()
        app.state.passwords.shutdown(wait=False, cancel_futures=True)
        watching_site.close()
        site.close()

    app = FastAPI(
        title="shm",
        version=shm.__version__,
        description=_DESCRIPTION,
        openapi_url=None,  # ours asks for a token where other pages do
        docs_url=None,  # its pages load scripts from elsewhere
        redoc_url=None,
        lifespan=lifespan,
    )
    app.state.site = site
    app.state.background_worker = BackgroundWorker()
    app.state.uploads = Counter[str]()
    app.state.passwords = ThreadPoolExecutor(1, "passwords")
    app.state.sign_ons = signing_in.SignOns()
    app.state.other_bridges = OtherBridges()
    app.state.exposition = Exposition(watching_site)
    handle_faults(app)
    app.include_router(metrics.router)
    for part in _PARTS:
        app.include_router(part.router, responses=answers(400, 401, 403, 503))
    app.include_router(_described)
    return app


@_described.get("/openapi.json")
def openapi(request: Request, _: Reader) -> JSONResponse:
    """Return the description of the interface as OpenAPI."""
    return JSONResponse(request.app.openapi())


log = logging.getLogger(__name__)


def warm_up(app: FastAPI) -> None:
    """Load what pages need, for about a second; requests are answered meanwhile."""
    frame.prepare_templates()
    try:
        summarize_hangers(app.state.site, utc_now())
    except ShmError as error:  # whoever asks is told too
        log.info("the first page will take longer: %s", error.message)
    app.openapi()
    # What was imported stays for good: to look through it for garbage takes 100 ms, amid a request.
    gc.freeze()
    # A page of 200 hangers makes some 50,000 objects, in no circle: to look through them each time
    # that there are 700 more took a tenth of its time (`tests/benchmarks/dashboard.py`).
    gc.set_threshold(20_000)
