"""The page where a person hands recordings in and sees each become a test."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response

from shm.report import formatting
from shm_daemon.web.access import AtSite, Reader
from shm_daemon.web.frame import page

router = APIRouter(include_in_schema=False)


@router.get("/upload")
def upload_page(request: Request, site: AtSite, _: Reader) -> Response:
    """Files go to `POST /api/recordings` one by one; `static/upload.js` follows each."""
    workspace = site.workspace
    return page(
        request,
        "upload.html.j2",
        hangers=[
            (each.id, formatting.hanger_name(each.id, each.name))
            for each in workspace.bridge.hangers
        ],
        max_mb=workspace.settings.max_file_bytes / 1e6,
        max_bytes=workspace.settings.max_file_bytes,
    )
