"""The report of a hanger as a file, and its results as a table."""

from __future__ import annotations

import csv
import io
import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from fastapi import APIRouter, Request
from fastapi.responses import Response

from shm.errors import NothingThere
from shm.pipeline import utc_now
from shm.pipeline.reporting import hanger_report
from shm.report.hanger_report import hanger_paper
from shm.store import Store, TrendPoint, Workspace
from shm.values import Hanger
from shm_daemon.web.access import AtSite, Reader
from shm_daemon.web.background_work import RETRY_AFTER, BackgroundWorker, background_worker_of
from shm_daemon.web.faults import Refused
from shm_daemon.web.hangers import Number, described

router = APIRouter(include_in_schema=False)

_TYPES = {"pdf": "application/pdf", "html": "text/html; charset=utf-8"}
# Judgement: a report takes 5 to 15 s; a browser's user waits for a minute, hardly longer.
_LONGEST_S = 60.0
_LOOK_S = 0.2
_FRESH_S = 60
"""A report is kept for so long: acknowledgements and notes change it without a new test."""
_COLUMNS = (
    "test", "time_utc", "temperature_c", "model", "tension_n", "tension_q05_n", "tension_q95_n",
    "repeatability_sd_n",
)  # fmt: skip


@dataclass(frozen=True)
class ReportOrder:
    """A report to be made in a process of its own: of which hanger, in which minute."""

    folder: Path
    hanger: int
    form: Literal["pdf", "html"]
    minute: int

    def make(self) -> bytes:
        workspace = Workspace.open(self.folder)
        with workspace.store() as store:
            paper = hanger_paper(hanger_report(workspace, store, self.hanger, utc_now()))
        if self.form == "pdf":
            from shm.report.as_pdf import as_pdf

            return as_pdf(paper)
        from shm.report.as_html import as_html

        return as_html(paper).encode()


@router.get("/hangers/{hanger_id}/report.{form}")
def report(
    request: Request, site: AtSite, _: Reader, hanger_id: Number, form: Literal["pdf", "html"]
) -> Response:
    """What `shm report` writes; 503 with `Retry-After` where many others wait."""
    _refuse_untested(site.store, described(site.workspace, hanger_id))
    minute = int(time.time() // _FRESH_S)
    order = ReportOrder(site.workspace.folder, hanger_id, form, minute)
    made = _awaited(background_worker_of(request), order)
    return _file(made, f"hanger{hanger_id}.{form}", _TYPES[form])


@router.get("/hangers/{hanger_id}/results.csv")
def results(site: AtSite, _: Reader, hanger_id: Number) -> Response:
    """Every test with its tension averaged over the model classes, in N, the oldest first."""
    hanger = described(site.workspace, hanger_id)
    _refuse_untested(site.store, hanger)
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(_COLUMNS)
    writer.writerows(_row(point) for point in site.store.posteriors.trend(hanger))
    return _file(text.getvalue().encode(), f"hanger{hanger_id}.csv", "text/csv; charset=utf-8")


def _refuse_untested(store: Store, hanger: Hanger) -> None:
    if not store.posteriors.latest_trends([hanger]):
        raise NothingThere(
            f"hanger {hanger.id} has no test to report.", remedy="Upload a recording of it."
        )


def _awaited(worker: BackgroundWorker[bytes], order: ReportOrder) -> bytes:
    ends_at = time.monotonic() + _LONGEST_S
    while (made := worker.wanted(order)) is None:
        if time.monotonic() > ends_at:
            raise Refused(503, "the report is not made yet.", "Ask again.", RETRY_AFTER)
        time.sleep(_LOOK_S)
    return made


def _file(content: bytes, name: str, kind: str) -> Response:
    headers = {"Content-Disposition": f'attachment; filename="{name}"'}
    return Response(content, headers=headers, media_type=kind)


def _row(point: TrendPoint) -> tuple[str, ...]:
    known = point.averaged.tension_n
    numbers = (known.mean, known.q05, known.q95, point.averaged.repeatability_sd_n)
    when = f"{point.taken_at:%Y-%m-%dT%H:%M:%SZ}" if point.taken_at else ""
    temperature = _cell(point.temperature_c)
    return (_inert(point.test), when, temperature, point.model, *map(_cell, numbers))


def _inert(name: str) -> str:
    """No formula for a spreadsheet: a test is named by whoever uploads its file."""
    return f"'{name}" if name.startswith(("=", "+", "-", "@")) else name


def _cell(value: float) -> str:
    """Empty where it is not known."""
    return f"{value:.6g}" if math.isfinite(value) else ""
