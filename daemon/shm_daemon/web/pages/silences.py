"""Silences and maintenance windows: made and ended on the page of alerts."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path, Request, Response
from fastapi.responses import RedirectResponse
from starlette.concurrency import run_in_threadpool

from shm.errors import BadInput
from shm.pipeline import utc_now
from shm_daemon.web.access import AtSite, Visitor, Writer
from shm_daemon.web.forms import form_of, reason_in, time_in
from shm_daemon.web.models import LARGEST_NUMBER
from shm_daemon.web.site import Site

router = APIRouter(prefix="/silences", include_in_schema=False)

_ALL = "all"
_SHOWN_AT = "/alerts#silences"


@router.post("")
async def make(request: Request, site: AtSite, writer: Writer) -> Response:
    """Holds the messages of hooks back for a while."""
    await run_in_threadpool(_make, site, writer, await form_of(request))
    return RedirectResponse(_SHOWN_AT, 303)


@router.post("/{number}/end")
def end(
    site: AtSite, writer: Writer, number: Annotated[int, Path(ge=0, le=LARGEST_NUMBER)]
) -> Response:
    """Ends one before its time."""
    store = site.store.acting_as(writer.actor)
    store.silences.end(number, writer.actor.name, utc_now())
    return RedirectResponse(_SHOWN_AT, 303)


def _make(site: Site, writer: Visitor, told: dict[str, str]) -> None:
    now, number, why = utc_now(), told.get("hanger", ""), reason_in(told, "a silence")
    since, until = time_in(told, "from") or now, time_in(told, "until")
    if until is None or not (number == _ALL or number.isdecimal()):
        raise BadInput("a silence has hangers and an end.", remedy="Choose them in the form.")
    hanger = None if number == _ALL else int(number)
    if hanger is not None:
        site.workspace.bridge.tested(hanger)
    who = writer.actor
    site.store.acting_as(who).silences.make(
        hanger, (since, until), who.name, why, now, is_maintenance="maintenance" in told
    )
