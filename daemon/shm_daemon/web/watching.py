"""For those who watch over the daemon: health, and metrics for Prometheus."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Request, Response
from fastapi.responses import JSONResponse

from shm_daemon.web.access import AtSite, Reader
from shm_daemon.web.faults import answers
from shm_daemon.web.front import HEALTH, METRICS
from shm_daemon.web.health import health_document
from shm_daemon.web.metrics import CONTENT_TYPE, Exposition
from shm_daemon.web.models import Health

router = APIRouter(tags=["watching"])


@router.get(
    HEALTH,
    response_model=Health,
    responses={
        **answers(400),
        503: {"model": Health, "description": "Store, spool or daemon fail."},
    },
    summary="Whether all is well",
)
def health(site: AtSite) -> Any:
    """Needs no token and tells no secrets: for load balancers and service managers.

    What works, though not as it is described now, is `degraded` and answers 200.
    """
    status, document = health_document(site)  # `front` has answered already, where it stands before
    return JSONResponse(document, status)


@router.get(
    METRICS,
    response_class=Response,
    responses={
        200: {"content": {CONTENT_TYPE: {"schema": {"type": "string"}}}},
        **answers(400, 401, 403),
    },
    summary="Metrics for Prometheus",
)
def metrics(request: Request, _: Reader) -> Response:
    """Computed from store and spool at each scrape; `shm_store_up` is 0 where the store is out, and
    `shm_scrape_errors_total` counts what could not be told.
    """
    exposition = request.app.state.exposition
    assert isinstance(exposition, Exposition)
    return Response(exposition.page(), headers={"Content-Type": CONTENT_TYPE})
