"""What counts, decided on the page: of what is held, and of what counted until now."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path, Request, Response
from fastapi.responses import RedirectResponse
from starlette.concurrency import run_in_threadpool

from shm.errors import BadInput
from shm.pipeline import utc_now
from shm.plausibility import refuse_impossible
from shm_daemon.web.access import AtSite, Visitor, Writer
from shm_daemon.web.forms import form_of, reason_in, time_in
from shm_daemon.web.models import LARGEST_NUMBER
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
    who, why, now = writer.actor, reason_in(told, "a decision"), utc_now()
    decisions = site.store.acting_as(who).recordings
    match told.get("action"):
        case "confirm":
            time = time_in(told, "time")
            refuse_impossible(time, site.workspace.bridge.built)
            decisions.confirm(recording, who.name, why, now, time)
        case "discard":
            decisions.discard(recording, who.name, why, now)
        case "withdraw":
            decisions.withdraw(recording, who.name, why, now, told.get("test"))
        case "reinstate":
            decisions.reinstate(recording, who.name, why, now)
        case _:
            raise BadInput("this is none of the decisions.", remedy="Choose one in the form.")
