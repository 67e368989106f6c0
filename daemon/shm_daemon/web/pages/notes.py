"""Notes and repairs: written on the page of a hanger or of the bridge; their photos."""

from __future__ import annotations

import re
from typing import Annotated

from fastapi import APIRouter, Path, Request, Response
from fastapi.responses import RedirectResponse
from starlette.concurrency import run_in_threadpool

from shm.documents import parse_time
from shm.errors import UsageError
from shm.pipeline import utc_now
from shm.store.notes import LARGEST_PHOTO_BYTES
from shm.values.notes import NoteKind
from shm_daemon.web.access import AtSite, Reader, Visitor, Writer
from shm_daemon.web.address import NOTES
from shm_daemon.web.faults import Refused
from shm_daemon.web.models import LARGEST_NUMBER
from shm_daemon.web.site import Site

router = APIRouter(prefix=NOTES, include_in_schema=False)

_LONGEST_FORM_BYTES = LARGEST_PHOTO_BYTES + 65_536  # technical: the text is far shorter
_NAME = re.compile(rb'[; ]name="([^"]*)"')
_BOUNDARY = re.compile(r'boundary="?([^";]+)')


@router.post("")
async def write(request: Request, site: AtSite, writer: Writer) -> Response:
    """Keeps what an operator wrote, and shows it where it was written."""
    told = await _form(request)
    return RedirectResponse(await run_in_threadpool(_write, site, writer, told), 303)


@router.get("/{number}/photo")
def photo(
    site: AtSite, _: Reader, number: Annotated[int, Path(ge=0, le=LARGEST_NUMBER)]
) -> Response:
    """The photo of a note."""
    return Response(site.store.notes.photo(number), media_type="image/jpeg")


def _write(site: Site, writer: Visitor, told: dict[str, bytes]) -> str:
    """The address at which the note is seen now."""
    words = {name: value.decode("utf-8", "replace").strip() for name, value in told.items()}
    number, now, who = words.get("hanger", ""), utc_now(), writer.actor
    try:
        hanger = int(number) if number else None
        at = parse_time(words["at"]) if words.get("at") else now
        kind = NoteKind(words.get("kind", ""))
    except (ValueError, OverflowError):
        raise UsageError(
            "a note has a hanger, a date and a kind.", remedy="Choose them in the form."
        ) from None
    if hanger is not None:
        site.workspace.bridge.tested(hanger)
    text = words.get("text", "").replace("\r\n", "\n")  # as browsers send lines
    store, image = site.store.acting_as(who), told.get("photo", b"")
    store.notes.add(hanger, at, kind, text, who.name, now, image)
    return "/#notes" if hanger is None else f"/hangers/{hanger}#notes"


async def _form(request: Request) -> dict[str, bytes]:
    """The fields of a form with a file, each once; raises Refused where it is too long or none."""
    found = _BOUNDARY.search(request.headers.get("content-type", ""))
    if found is None:
        raise Refused(415, "This is no form with a file.", "Send it from our page.")
    body = bytearray()
    async for piece in request.stream():
        body += piece
        if len(body) > _LONGEST_FORM_BYTES:
            raise Refused(413, "The photo has more than 5 MB.", "Give a smaller one.")
    fields = {}
    for part in bytes(body).split(b"--" + found[1].encode())[1:-1]:
        head, _, content = part.partition(b"\r\n\r\n")
        if name := _NAME.search(head):
            fields[name[1].decode("utf-8", "replace")] = content.removesuffix(b"\r\n")
    return fields
