"""What the first visitor need not wait for: done beside, as soon as the interface begins."""

from __future__ import annotations

import gc

from fastapi import FastAPI

from shm_daemon.web.frame import prepare_templates


def warm_up(app: FastAPI) -> None:
    """Takes less than a second; requests are answered meanwhile."""
    prepare_templates()
    app.openapi()
    # What was imported stays for good: to look through it for garbage takes 100 ms, amid a request.
    gc.freeze()
