"""Notes and repairs: written on the page of a hanger or of the bridge; their photos."""

from __future__ import annotations

from fastapi import APIRouter, Response
from fastapi.responses import RedirectResponse

from shm.documents import parse_time
from shm.errors import UsageError
from shm.pipeline import utc_now
from shm.values.notes import NoteKind
from shm_daemon.web.access import AtSite, Reader, Uploader
from shm_daemon.web.address import NOTES
from shm_daemon.web.forms import FormWithPhoto
from shm_daemon.web.models import Row

router = APIRouter(prefix=NOTES, include_in_schema=False)


@router.post("")
def write(site: AtSite, writer: Uploader, form: FormWithPhoto) -> Response:
    """Store a note of an operator, and show it where it was written."""
    texts, photo = form
    words = {name: text.strip() for name, text in texts.items()}
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
    site.store.acting_as(who).notes.add(hanger, at, kind, text, who.name, now, photo)
    return RedirectResponse("/#notes" if hanger is None else f"/hangers/{hanger}#notes", 303)


@router.get("/{number}/photo")
def photo(site: AtSite, _: Reader, number: Row) -> Response:
    """Return the photo of a note."""
    return Response(site.store.notes.photo(number), media_type="image/jpeg")
