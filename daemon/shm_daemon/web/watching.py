"""For those who watch over the daemon: health, and metrics for Prometheus."""

from __future__ import annotations

import logging
import os
from datetime import timedelta
from typing import Any

from fastapi import APIRouter, Response
from fastapi.responses import JSONResponse

from shm.errors import ShmError
from shm_daemon.doctor.contract import told
from shm_daemon.heartbeat import patience_s, seconds_since_beat
from shm_daemon.web.access import AtSite, Reader
from shm_daemon.web.faults import answers
from shm_daemon.web.metrics import CONTENT_TYPE, exposition
from shm_daemon.web.models import Health
from shm_daemon.web.site import Site

router = APIRouter(tags=["watching"])
log = logging.getLogger(__name__)


@router.get(
    "/health",
    response_model=Health,
    responses={
        **answers(400),
        503: {"model": Health, "description": "Store, spool or daemon fail."},
    },
    summary="Whether all is well",
)
def health(site: AtSite) -> Any:
    """Needs no token and tells no secrets: for load balancers and service managers."""
    reasons = troubles(site)
    found = Health(status="failing" if reasons else "ok", reasons=reasons)
    return JSONResponse(found.model_dump(), 503) if reasons else found


def troubles(site: Site) -> list[str]:
    """Why work stands still; empty where all is well."""
    return [*_store(site), *_spool(site), *_daemon(site)]


@router.get(
    "/metrics",
    response_class=Response,
    responses={
        200: {"content": {CONTENT_TYPE: {"schema": {"type": "string"}}}},
        **answers(400, 401, 403),
    },
    summary="Metrics for Prometheus",
)
def metrics(site: AtSite, _: Reader) -> Response:
    """Computed from store and spool at each scrape; `shm_store_up` is 0 where the store is out."""
    return Response(exposition(site), headers={"Content-Type": CONTENT_TYPE})


def _store(site: Site) -> list[str]:
    try:
        site.store.stage_counts()
    except ShmError as error:
        log.error("%s", error)
        return ["The store cannot be used."]
    return []


def _spool(site: Site) -> list[str]:
    if os.access(site.workspace.spool, os.W_OK | os.X_OK):
        return []
    return ["The spool cannot be written."]


def _daemon(site: Site) -> list[str]:
    ago = seconds_since_beat(site.workspace)
    if ago is None:
        return ["The daemon has never run here."]
    if ago > patience_s(site.workspace):
        return [f"The daemon was last seen {told(timedelta(seconds=ago))} ago."]
    return []
