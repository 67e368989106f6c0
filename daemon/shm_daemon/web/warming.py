"""What the first visitor need not wait for: done beside, as soon as the interface begins."""

from __future__ import annotations

import gc
import logging

from fastapi import FastAPI

from shm.errors import ShmError
from shm.pipeline import utc_now
from shm_daemon.web.bridge_view import glance
from shm_daemon.web.frame import prepare_templates

log = logging.getLogger(__name__)


def warm_up(app: FastAPI) -> None:
    """Takes about a second; requests are answered meanwhile."""
    prepare_templates()
    try:
        glance(app.state.site, utc_now())
    except ShmError as error:  # whoever asks is told too
        log.info("the first page will take longer: %s", error.message)
    app.openapi()
    # What was imported stays for good: to look through it for garbage takes 100 ms, amid a request.
    gc.freeze()
