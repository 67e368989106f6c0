"""The page where somebody has a hanger's gap diagnosed, and sees that it goes on."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from fastapi import APIRouter, Request, Response
from fastapi.responses import HTMLResponse, RedirectResponse

from shm.pipeline import utc_now
from shm.pipeline.diagnosing import choose_tests, diagnose_stored, latest_tests
from shm.report import formatting
from shm.report.diagnosis_summary import write_summary
from shm.store import Workspace
from shm.store.journal import Actor
from shm_daemon.web.access import AtSite, Reader, Writer
from shm_daemon.web.background_work import background_worker_of, still_at_work
from shm_daemon.web.forms import Form
from shm_daemon.web.frame import page
from shm_daemon.web.models import HangerNumber
from shm_daemon.web.site import described

router = APIRouter(prefix="/hangers/{hanger_id}/diagnosis", include_in_schema=False)


@dataclass(frozen=True)
class Diagnose:
    """A request to diagnose the latest tests of a hanger, as of one moment: it is made once.

    With `every` tests from before the last change are among them.
    """

    folder: Path
    hanger: int
    actor: Actor
    at: datetime
    every: bool = False

    def make(self) -> str:
        """Diagnose and keep it; return its first paragraph."""
        from shm.gap import GapOptions

        workspace = Workspace.described(self.folder)
        hanger = workspace.bridge.hanger(self.hanger)
        with workspace.store() as store:
            acting = store.acting_as(self.actor)
            chosen = choose_tests(acting, hanger, every=self.every)
            found = diagnose_stored(acting, chosen, hanger, GapOptions(), self.at)
            return f"{write_summary(found)} {chosen.remark}".rstrip()


@router.post("")
def order_diagnosis(
    request: Request,
    site: AtSite,
    writer: Writer,
    hanger_id: HangerNumber,
    form: Form,
) -> Response:
    """Have it made beside the interface."""
    one = described(site.workspace, hanger_id)
    latest_tests(site.store, one, 1)
    wanted = Diagnose(site.workspace.folder, one.id, writer.actor, utc_now(), "all_tests" in form)
    word = background_worker_of(request).place(wanted)
    return RedirectResponse(f"/hangers/{one.id}/diagnosis?order={word}", 303)


@router.get("")
def diagnosis_page(
    request: Request, site: AtSite, _: Reader, hanger_id: HangerNumber, order: str = ""
) -> HTMLResponse:
    """Show that a diagnosis goes on, and what it found."""
    one = described(site.workspace, hanger_id)
    name = formatting.hanger_name(one.id, one.name)
    return page(request, "diagnosis.html.j2", name=name, hanger=one, order=order)


@router.get("/outcome")
def outcome(request: Request, _: Reader, hanger_id: HangerNumber, order: str) -> Response:
    """Return the outcome of a request without the frame; 202 while it is computed."""
    work = background_worker_of(request)
    found = work.outcome(order, f"Whether it was made, the page of hanger {hanger_id} says.")
    if found is None:
        return still_at_work(
            f"Being diagnosed for {work.seconds(order):.0f} s. It takes 10 s to two minutes, and "
            "longer while the daemon is at work. You can leave this page."
        )
    return page(request, "diagnosis_outcome.html.j2", summary=found, hanger_id=hanger_id)
