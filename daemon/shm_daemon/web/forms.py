"""Define the forms of pages, check what is entered, and answer with the next page or the reason."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from datetime import datetime
from typing import Annotated, Any
from urllib.parse import parse_qs

from fastapi import Depends, Request, Response
from fastapi.responses import RedirectResponse

from shm.documents import parse_time
from shm.errors import BadInput, NothingThere, UsageError
from shm.store.notes import LARGEST_PHOTO_BYTES
from shm_daemon.web.faults import Refused

_MOST_FIELDS = 10  # technical: the longest of our forms, but that of settings, has six
_MOST_SETTINGS = 1000  # technical: three fields each of some 20 settings and of 100 hooks
_LONGEST_BYTES = 32_768  # technical: a reason of 2,000 letters has 12 each at most as browsers send
_LONGEST_OF_ANYBODY_BYTES = 8192  # technical: a token and an address have some hundreds
_LONGEST_WITH_PHOTO_BYTES = LARGEST_PHOTO_BYTES + 65_536  # technical: the text is far shorter
_NAME = re.compile(rb'[; ]name="([^"]*)"')
_BOUNDARY = re.compile(r'boundary="?([^";]+)')


def _up_to(longest_bytes: int, most_fields: int = _MOST_FIELDS) -> Any:
    """Return a reader of forms up to a length; it raises Refused for longer ones."""

    async def fields(request: Request) -> dict[str, str]:
        body = await _body(
            request, longest_bytes, "This is more than the form asks for.", "Write less."
        )
        found = parse_qs(body.decode("utf-8", "replace"), max_num_fields=most_fields)
        return {name: values[-1] for name, values in found.items()}

    return Depends(fields)


async def _with_photo(request: Request) -> dict[str, bytes]:
    """Raise Refused where it is too long, or no form with a file."""
    found = _BOUNDARY.search(request.headers.get("content-type", ""))
    if found is None:
        raise Refused(415, "This is no form with a file.", "Send it from our page.")
    body = await _body(
        request, _LONGEST_WITH_PHOTO_BYTES, "The photo has more than 5 MB.", "Give a smaller one."
    )
    fields = {}
    for part in body.split(b"--" + found[1].encode())[1:-1]:
        head, _, content = part.partition(b"\r\n\r\n")
        if name := _NAME.search(head):
            fields[name[1].decode("utf-8", "replace")] = content.removesuffix(b"\r\n")
    return fields


async def _body(request: Request, longest_bytes: int, message: str, remedy: str) -> bytes:
    body = bytearray()
    async for piece in request.stream():
        body += piece
        if len(body) > longest_bytes:
            raise Refused(413, message, remedy)
    return bytes(body)


# The fields of a form, each once. Name it after `Writer` or `Engineer`: nothing of a stranger's
# form is read.
Form = Annotated[dict[str, str], _up_to(_LONGEST_BYTES)]
FormOfSettings = Annotated[dict[str, str], _up_to(4 * _LONGEST_BYTES, _MOST_SETTINGS)]
FormOfAnybody = Annotated[dict[str, str], _up_to(_LONGEST_OF_ANYBODY_BYTES)]
FormWithPhoto = Annotated[dict[str, bytes], Depends(_with_photo)]


def redirect_or_show_error(
    does: Callable[[], object], then: str, again: Callable[[str, int], Response]
) -> Response:
    """Send to the address `then` what a form asked for; `again` shows why it was not done."""
    try:
        does()
    except (BadInput, NothingThere, UsageError) as error:
        status = 422 if isinstance(error, BadInput) else 409
        return again(f"{error.message} {error.remedy}", status)
    except Refused as error:
        return again(f"{error.detail} {error.remedy}", error.status_code)
    return RedirectResponse(then, 303)


def reason_in(form: Mapping[str, str], of: str) -> str:
    """Return the reason for the record; raises UsageError if it is empty."""
    why = form.get("why", "").replace("\r\n", "\n").strip()  # as browsers send lines
    if not why:
        raise UsageError(f"{of} needs a reason.", remedy="Write why, for the record.")
    return why


def time_in(form: Mapping[str, str], name: str) -> datetime | None:
    """Return a time or day in UTC, None where the field is empty; raises BadInput."""
    text = form.get(name, "")
    try:
        return parse_time(text) if text else None
    except (ValueError, OverflowError):
        raise BadInput(f"{text!r} is no time.", remedy="Write it as 2026-05-01T10:00.") from None
