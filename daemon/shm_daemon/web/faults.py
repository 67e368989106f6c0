"""Errors as responses: a status, the problem and a remedy.

A document where a document was asked for, a page where a page was.
"""

from __future__ import annotations

import logging
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse, Response
from pydantic import BaseModel
from starlette.exceptions import HTTPException

from shm.errors import (
    DISK_FULL,
    BadInput,
    DoubledChunk,
    NothingThere,
    ShmError,
    StoreError,
    TooLarge,
    UsageError,
)
from shm_daemon.web.frame import for_a_person, problem

log = logging.getLogger(__name__)

# Statuses as RFC 9110 defines them, 429 as RFC 6585.
_STATUS: tuple[tuple[type[ShmError], int], ...] = (
    (TooLarge, 413),
    (DoubledChunk, 409),
    (NothingThere, 404),
    (BadInput, 422),
    (UsageError, 409),
    (StoreError, 503),
)
_WORDS = {
    400: "The request itself is off, or its Host is not ours.",
    401: "A token is missing, wrong or revoked.",
    403: "The token does not allow this.",
    404: "There is no such thing, or not yet.",
    408: "The sender fell silent.",
    409: "This was done already.",
    413: "The file is larger than is taken.",
    415: "The body is no plain file.",
    422: "A value cannot be used.",
    429: "Too many wrong tokens came from this address; `Retry-After` says how long to wait.",
    503: "The store cannot be used now; `Retry-After` says when to try again.",
}


class Fault(BaseModel):
    """A problem and its remedy."""

    message: str
    remedy: str = ""


class Refused(HTTPException):
    """An answer that is no result, with a remedy."""

    def __init__(
        self, status: int, message: str, remedy: str = "", headers: dict[str, str] | None = None
    ):
        super().__init__(status, message, headers)
        self.remedy = remedy


def answers(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """Return the faults that a route documents; 401 includes 429, for too many wrong tokens."""
    if 401 in statuses:
        statuses = (*statuses, 429)
    return {status: {"model": Fault, "description": _WORDS[status]} for status in statuses}


def handle_faults(app: FastAPI) -> None:
    """Turn every error into an answer of ours; one that is not ours is logged and not told."""
    app.add_exception_handler(HTTPException, _refused)
    app.add_exception_handler(RequestValidationError, _invalid)
    app.add_exception_handler(ShmError, _known)
    app.add_exception_handler(Exception, _unknown)


def fault(
    status: int, message: str, remedy: str = "", headers: dict[str, str] | None = None
) -> JSONResponse:
    """Return the answer itself."""
    return JSONResponse(Fault(message=message, remedy=remedy).model_dump(), status, headers)


def _response(
    request: Request,
    status: int,
    message: str,
    remedy: str = "",
    headers: dict[str, str] | None = None,
) -> Response:
    if for_a_person(request):
        return problem(request, status, message, remedy, headers)
    return fault(status, message, remedy, headers)


def _refused(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    headers = dict(error.headers) if error.headers else None
    remedy, message = getattr(error, "remedy", ""), error.detail
    if message == "Not Found":  # as the framework says it
        message = "There is no such page."
    return _response(request, error.status_code, message, remedy, headers)


def _invalid(request: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)
    first = error.errors()[0]
    where = " ".join(str(part) for part in first["loc"])
    remedy = "See /openapi.json for what is expected."
    return _response(request, 422, f"{where}: {first['msg']}.", remedy)


def _known(request: Request, error: Exception) -> Response:
    assert isinstance(error, ShmError)
    status = next((code for kind, code in _STATUS if isinstance(error, kind)), 500)
    if error.retry_after_s is not None:
        status = 503
    headers = {"Retry-After": f"{error.retry_after_s or 60:.0f}"} if status == 503 else None
    if status >= 500:
        log.error("%s", error)
    return _response(request, status, error.message, error.remedy, headers)


def _unknown(request: Request, error: Exception) -> Response:
    if isinstance(error, OSError) and error.errno in DISK_FULL:
        return _response(request, 503, "the disk is full.", "Make room on it, and send it again.")
    return _response(request, 500, "an internal error.", "The log of the web interface says more.")
