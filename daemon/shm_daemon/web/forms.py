"""The forms of pages: their fields, and what a person must have written in them."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from urllib.parse import parse_qs

from fastapi import Request

from shm.documents import parse_time
from shm.errors import BadInput, UsageError
from shm_daemon.web.faults import Refused

_MOST_FIELDS = 10  # technical: the longest of our forms has six
_LONGEST_BYTES = 32_768  # technical: a reason of 2,000 letters has 12 each at most as browsers send


async def form_of(request: Request, longest_bytes: int = _LONGEST_BYTES) -> dict[str, str]:
    """The fields of a form, each once; raises Refused where there is far more than we ask for."""
    body = bytearray()
    async for piece in request.stream():
        body += piece
        if len(body) > longest_bytes:
            raise Refused(413, "This is more than the form asks for.", "Write less.")
    fields = parse_qs(body.decode("utf-8", "replace"), max_num_fields=_MOST_FIELDS)
    return {name: values[-1] for name, values in fields.items()}


def reason_in(told: Mapping[str, str], of: str) -> str:
    """Why, for the record; raises UsageError where nothing is written."""
    why = told.get("why", "").replace("\r\n", "\n").strip()  # as browsers send lines
    if not why:
        raise UsageError(f"{of} needs a reason.", remedy="Write why, for the record.")
    return why


def time_in(told: Mapping[str, str], name: str) -> datetime | None:
    """A time or day in UTC, None where the field is empty; raises BadInput."""
    text = told.get(name, "")
    try:
        return parse_time(text) if text else None
    except (ValueError, OverflowError):
        raise BadInput(f"{text!r} is no time.", remedy="Write it as 2026-05-01T10:00.") from None
