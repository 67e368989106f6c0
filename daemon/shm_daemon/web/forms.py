"""Define the forms of pages, check what is entered, and answer with the next page or the reason."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from datetime import datetime
from typing import Annotated, Any

from fastapi import Depends, Request, Response
from fastapi.responses import RedirectResponse
from starlette.datastructures import FormData, UploadFile
from starlette.exceptions import HTTPException
from starlette.types import Message

from shm.documents import parse_time
from shm.errors import BadInput, NothingThere, UsageError
from shm.store.notes import LARGEST_PHOTO_BYTES
from shm_daemon.web.faults import Refused

_MOST_FIELDS = 10  # technical: the longest of our forms, but that of settings, has six
_MOST_SETTINGS = 1000  # technical: three fields each of some 20 settings and of 100 hooks
_LONGEST_BYTES = 32_768  # technical: a reason of 2,000 letters has 12 each at most as browsers send
_LONGEST_OF_ANYBODY_BYTES = 8192  # technical: a token and an address have some hundreds
_LONGEST_WITH_PHOTO_BYTES = LARGEST_PHOTO_BYTES + 65_536  # technical: the text is far shorter
_FROM_OUR_PAGE = "Send it from our page."


def _up_to(longest_bytes: int, most_fields: int = _MOST_FIELDS) -> Any:
    """Return a reader of forms up to a length; it raises Refused for longer ones."""

    async def fields(request: Request) -> dict[str, str]:
        limited = _limited(request, longest_bytes, "This is more than the form asks for.")
        async with _parsed(limited, longest_bytes, max_files=0, max_fields=most_fields) as form:
            return _texts(form)

    return Depends(fields)


async def _with_photo(request: Request) -> tuple[dict[str, str], bytes]:
    """Return the texts and the photo; raise Refused if it is too long or no form with a file."""
    if not request.headers.get("content-type", "").lower().startswith("multipart/form-data"):
        raise Refused(415, "This is no form with a file.", _FROM_OUR_PAGE)
    limited = _limited(request, _LONGEST_WITH_PHOTO_BYTES, "The photo has more than 5 MB.")
    async with _parsed(limited, _LONGEST_BYTES, max_files=1, max_fields=_MOST_FIELDS) as form:
        photo = form.get("photo")
        return _texts(form), await photo.read() if isinstance(photo, UploadFile) else b""


@asynccontextmanager
async def _parsed(request: Request, part_bytes: int, **limits: int) -> AsyncIterator[FormData]:
    """Parse a form, long files on disk until the context ends; raise Refused if it is malformed."""
    try:
        form = await request.form(max_part_size=part_bytes, **limits)
    except Refused:
        raise
    except HTTPException as error:
        raise Refused(400, error.detail, _FROM_OUR_PAGE) from None
    try:
        yield form
    finally:
        await form.close()


def _texts(form: FormData) -> dict[str, str]:
    """Return the fields that are filled in, the last of those of one name."""
    return {name: text for name, text in form.items() if isinstance(text, str) and text}


def _limited(request: Request, longest_bytes: int, message: str) -> Request:
    """Return the request with a body that raises Refused beyond a length."""
    received = 0

    async def receive() -> Message:
        nonlocal received
        piece = await request.receive()
        received += len(piece.get("body", b""))
        if received > longest_bytes:
            raise Refused(413, message, "Send less.")
        return piece

    return Request(request.scope, receive)


# The fields of a form, each once. Name it after `Writer` or `Engineer`: nothing of a stranger's
# form is read.
Form = Annotated[dict[str, str], _up_to(_LONGEST_BYTES)]
FormOfSettings = Annotated[dict[str, str], _up_to(4 * _LONGEST_BYTES, _MOST_SETTINGS)]
FormOfAnybody = Annotated[dict[str, str], _up_to(_LONGEST_OF_ANYBODY_BYTES)]
FormWithPhoto = Annotated[tuple[dict[str, str], bytes], Depends(_with_photo)]


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
