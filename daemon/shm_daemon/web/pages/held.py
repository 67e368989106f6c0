"""What counts, decided on the page: of what is held, and of what counted until now."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from fastapi import APIRouter, Path, Request, Response
from fastapi.responses import RedirectResponse
from starlette.concurrency import run_in_threadpool

from shm.documents import parse_time
from shm.errors import BadInput, UsageError
from shm.pipeline import utc_now
from shm.plausibility import refuse_impossible
from shm_daemon.web.access import AtSite, Visitor, Writer
from shm_daemon.web.models import LARGEST_NUMBER
from shm_daemon.web.signing_in import form_of
from shm_daemon.web.site import Site

router = APIRouter(prefix="/held", include_in_schema=False)


@router.post("/{recording}")
async def decide(
    request: Request,
    site: AtSite,
    writer: Writer,
    recording: Annotated[int, Path(ge=0, le=LARGEST_NUMBER)],
) -> Response:
    """Lets a recording count from now on, or takes it out; the daemon does what follows."""
    await run_in_threadpool(_decide, site, writer, recording, await form_of(request))
    return RedirectResponse(f"/operation?decided={recording}#held", 303)


def _decide(site: Site, writer: Visitor, recording: int, told: dict[str, str]) -> None:
    who, why, now = writer.actor, told.get("why", "").strip(), utc_now()
    decisions = site.store.acting_as(who).recordings
    if not why:
        raise UsageError("a decision needs a reason.", remedy="Write why, for the record.")
    match told.get("action"):
        case "confirm":
            decisions.confirm(recording, who.name, why, now, _time(site, told.get("time", "")))
        case "discard":
            decisions.discard(recording, who.name, why, now)
        case "withdraw":
            decisions.withdraw(recording, who.name, why, now, told.get("test"))
        case "reinstate":
            decisions.reinstate(recording, who.name, why, now)
        case _:
            raise BadInput("this is none of the decisions.", remedy="Choose one in the form.")


def _time(site: Site, text: str) -> datetime | None:
    try:
        time = parse_time(text) if text else None
    except (ValueError, OverflowError):
        raise BadInput(f"{text!r} is no time.", remedy="Write it as 2026-05-01T10:00.") from None
    refuse_impossible(time, site.workspace.bridge.built)
    return time
