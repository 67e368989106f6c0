"""Puts the web interface together."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from fastapi import FastAPI

import shm
from shm.store import Workspace
from shm_daemon.web import alerts, hanger_numbers, hangers, recordings, signing_in, tests, watching
from shm_daemon.web.address import Address
from shm_daemon.web.around import Around
from shm_daemon.web.faults import handle_faults
from shm_daemon.web.pages import alerts as alerts_page
from shm_daemon.web.pages import bridge, hanger, health, static, test, upload
from shm_daemon.web.site import Site
from shm_daemon.web.working_out import Workshop

_DESCRIPTION = (
    "Recordings come in, states and alerts are read, alerts are acknowledged. Answers that are no "
    "result are `{message, remedy}`. Forces in N, times in UTC."
)


def make_app(workspace: Workspace, address: Address | None = None) -> FastAPI:
    """The interface of one workspace, as it listens at `address` (by default this machine only)."""
    site = Site(workspace, address or Address())

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        yield
        app.state.workshop.close()
        site.close()

    app = FastAPI(
        title="shm",
        version=shm.__version__,
        description=_DESCRIPTION,
        docs_url=None,  # its pages load scripts from elsewhere
        redoc_url=None,
        lifespan=lifespan,
    )
    app.state.site = site
    app.state.workshop = Workshop()
    handle_faults(app)
    for part in (
        recordings,
        hangers,
        alerts,
        watching,
        signing_in,
        static,
        bridge,
        alerts_page,
        upload,
        health,
        tests,
        test,
        hanger_numbers,
        hanger,
    ):
        app.include_router(part.router)
    app.add_middleware(Around, site=site)
    return app
