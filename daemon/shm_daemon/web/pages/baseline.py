"""The page where an engineer compares a hanger with itself as it is since some day."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from fastapi import APIRouter, Request, Response
from fastapi.responses import HTMLResponse, RedirectResponse

from shm.errors import BadInput
from shm.pipeline import utc_now
from shm.pipeline.rebaselining import Order, set_baseline
from shm.report import formatting
from shm.store import Workspace
from shm.store.journal import Actor
from shm.watch.repair_check import EVENT_KINDS
from shm_daemon.web.access import AtSite, Engineer
from shm_daemon.web.background_work import background_worker_of, still_at_work
from shm_daemon.web.forms import Form, reason_in, time_in
from shm_daemon.web.frame import page
from shm_daemon.web.models import HangerNumber
from shm_daemon.web.site import described

router = APIRouter(prefix="/hangers/{hanger_id}/baseline", include_in_schema=False)

_AT_WORK = "Its tests are updated together; that takes some seconds …"


@dataclass(frozen=True)
class Outcome:
    """Outcome of a request, to be shown."""

    warning: str
    sentences: tuple[str, ...]


@dataclass(frozen=True)
class SetBaseline:
    """An order to make one, as of one moment: it is made once."""

    folder: Path
    hanger: int
    order: Order
    actor: Actor
    at: datetime

    def make(self) -> Outcome:
        workspace = Workspace.described(self.folder)
        with workspace.store() as store:
            hanger = workspace.bridge.hanger(self.hanger)
            acting = store.acting_as(self.actor)
            found = set_baseline(workspace, acting, hanger, self.order, self.at)
        return Outcome(found.warning, found.sentences)


@router.get("")
def baseline_page(
    request: Request, site: AtSite, _: Engineer, hanger_id: HangerNumber, order: str = ""
) -> HTMLResponse:
    """Show the baseline, the form for another, and the outcome of a request."""
    one = described(site.workspace, hanger_id)
    return page(
        request,
        "baseline.html.j2",
        name=formatting.hanger_name(one.id, one.name),
        hanger=one,
        now=site.store.watch.baseline(one.id),
        kinds=list(EVENT_KINDS),
        order=order,
        at_work=_AT_WORK,
    )


@router.post("")
def order_baseline(
    request: Request, site: AtSite, engineer: Engineer, hanger_id: HangerNumber, form: Form
) -> Response:
    """Start a new baseline in the background."""
    one = described(site.workspace, hanger_id)
    since, why, kind = time_in(form, "since"), reason_in(form, "a baseline"), form.get("kind", "")
    if since is None:
        raise BadInput("a baseline has a first day.", remedy="Choose it in the form.")
    if since > utc_now():
        raise BadInput(
            f"{since:%Y-%m-%d} is yet to come, and a baseline is made of tests that were done.",
            remedy=f"Choose the day since which tests of hanger {one.id} count.",
        )
    if kind and kind not in EVENT_KINDS:
        raise BadInput(f"{kind!r} is nothing that can be done.", remedy="Choose it in the form.")
    order = Order(since, why, engineer.actor.name, EVENT_KINDS[kind] if kind else None)
    wanted = SetBaseline(site.workspace.folder, one.id, order, engineer.actor, utc_now())
    word = background_worker_of(request).place(wanted)
    return RedirectResponse(f"/hangers/{one.id}/baseline?order={word}", 303)


@router.get("/outcome")
def outcome(request: Request, _: Engineer, hanger_id: HangerNumber, order: str) -> Response:
    """Return the outcome of a request without the frame; 202 while it is computed."""
    found = background_worker_of(request).outcome(
        order, f"Whether it was made, the page of hanger {hanger_id} says."
    )
    if found is None:
        return still_at_work(_AT_WORK)
    return page(request, "baseline_outcome.html.j2", told=found)
