"""Documents and figures of one test. Unknown numbers are null."""

from __future__ import annotations

from dataclasses import asdict
from datetime import datetime
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Path, Query, Request
from fastapi.responses import JSONResponse, Response

from shm import modes_document
from shm.errors import NothingThere
from shm.report import formatting
from shm.report.paper import Table
from shm.report.shared_tables import overall
from shm.store import FormerPosterior, FormerTest
from shm.store.journal import list_former_tests, list_steps
from shm.store.rows import Entry
from shm.store.tests import find_neighbours
from shm_daemon.web.access import AtSite, Reader
from shm_daemon.web.address import name_in
from shm_daemon.web.background_work import RETRY_AFTER, background_worker_of
from shm_daemon.web.faults import answers
from shm_daemon.web.modal_test_view import AT_WORK, FIGURES, ModalTestView
from shm_daemon.web.models import FigureDocument, HangerNumber, Underway, document
from shm_daemon.web.site import described

_AT_ONCE_S = 0.05  # what would be rounded to 0.0 s


def origin(view: ModalTestView) -> Table:
    """Return file, checksums and version; a checksum is complete, for comparison."""
    file, lineage = view.recording.file, view.stored.lineage
    size, is_now = file.size_bytes, view.order.terms == lineage
    remedy = f"have changed since: `shm ingest --again {view.recording.id}` identifies it again"
    facts = {
        "raw file": file.file_name,
        "its SHA-256": file.sha256,
        "its size": f"{size / 1e6:.2f} MB" if size >= 1e5 else f"{size} bytes",
        "received": formatting.moment(view.recording.received_at),
        "in the archive": "yes" if view.is_archived else "no: taken out",
        "sidecar": "came with it" if file.sidecar_as else "none",
        "checksum of the input": lineage.input_sha256,
        "checksum of the settings": lineage.settings_sha256,
        "identified with": f"shm {lineage.version}",
        "settings, description and version": "as they are now" if is_now else remedy,
    }
    return Table("Raw file and lineage", ("what", "value"), tuple(facts.items()))


def steps_of(view: ModalTestView) -> tuple[Entry, ...]:
    """Return the steps of the file, and those of this test of it."""
    found = list_steps(view.store, view.recording.id)
    return tuple(step for step in found if step.test in (None, view.stored.test.id))


def steps(view: ModalTestView) -> Table:
    """Return each stage that was reached and when, with the time since the one before."""
    found = steps_of(view)
    before: list[datetime | None] = [None, *(step.at for step in found)]
    rows = tuple(
        (
            step.kind,
            "test" if step.test else "file",
            f"{step.at:%Y-%m-%d %H:%M:%S} UTC",
            _after(step.at, then),
            f"shm {step.version}" if step.version else "not noted",
        )
        for step, then in zip(found, before, strict=False)
    )
    return Table("Steps", ("stage", "of", "reached", "after", "with"), rows)


def formers_of(view: ModalTestView) -> tuple[FormerTest, ...]:
    """Return every identification of this test, in force or superseded, oldest first."""
    found = list_former_tests(view.store, view.recording.id)
    return tuple(each for each in found if each.name == view.stored.test.id)


def _replaced(
    view: ModalTestView,
) -> list[tuple[str | None, datetime, FormerTest | FormerPosterior]]:
    """Return replaced results: model class (None for an identification), time, result."""
    found: list[tuple[str | None, datetime, FormerTest | FormerPosterior]] = []
    for test in formers_of(view):
        found.append((None, test.identified_at, test))
        found += [(each.model, each.updated_at, each) for each in test.posteriors]
    return [each for each in found if each[2].superseded_at]


def superseded(view: ModalTestView) -> Table:
    """Return identifications and posteriors that later runs have replaced."""
    rows = tuple(
        (
            f"posterior, {formatting.model_class(model)}" if model else "identification",
            formatting.moment(made_at),
            formatting.moment(former.superseded_at) if former.superseded_at else "",
            f"shm {former.lineage.version}",
            former.lineage.settings_sha256[:12],
        )
        for model, made_at, former in _replaced(view)
    )
    return Table("Superseded results", ("what", "made", "superseded", "with", "settings"), rows)


def _after(at: datetime, then: datetime | None) -> str:
    seconds = (at - then).total_seconds() if then else 0.0
    if seconds < _AT_ONCE_S:
        return "at once"
    if seconds < 3600:
        return f"{formatting.plain(seconds)} s"
    return f"{formatting.plain(seconds / 3600)} h"


# Status as RFC 9110 defines it.
_LATER: dict[int | str, dict[str, Any]] = {
    202: {"model": Underway, "description": "It is being worked out; `Retry-After` says how long."}
}
_OF_TEST = "/hangers/{hanger_id}/tests/{test:path}"

# Statuses as RFC 9110 defines them.
router = APIRouter(prefix="/api", tags=["state"], responses=answers(404, 422))
# Technical: a file name of 255 bytes has 765 characters when encoded; no test has more responses.
Name = Annotated[str, Path(max_length=1000, description="The test's name, percent-encoded.")]
MOST_RESPONSES = 100_000
Point = Annotated[
    int,
    Query(
        ge=0, le=MOST_RESPONSES, description="Which response, from 0 in the order of `responses`."
    ),
]


def view_of(request: Request, site: AtSite, hanger_id: HangerNumber, test: Name) -> ModalTestView:
    """Return the test that is asked for; raises NothingThere."""
    store = site.store
    stored = store.tests.named(described(site.workspace, hanger_id).id, name_in(test))
    recording = store.recordings.get(stored.recording_id)
    return ModalTestView(site.workspace, store, background_worker_of(request), stored, recording)


View = Annotated[ModalTestView, Depends(view_of)]


@router.get(
    _OF_TEST + "/figures/{figure}",
    response_model=FigureDocument,
    responses=_LATER,
    summary="One figure of a test",
)
def figure(
    _: Reader,
    view: View,
    figure: Annotated[str, Path(description="One of the names in `figures` of the test.")],
    point: Point = 0,
) -> Response:
    """Return a plotly document. A 200 with `Retry-After` is what the store has; more will come."""
    if figure not in FIGURES:
        raise NothingThere(f"no figure {figure!r}.", remedy=f"Known: {', '.join(FIGURES)}.")
    found = view.figure(FIGURES[figure], point)
    if found.document is None:
        return waiting()
    headers = RETRY_AFTER if found.provisional else None
    return Response(found.document, headers=headers, media_type="application/json")


@router.get(
    _OF_TEST + "/hits",
    responses=_LATER,
    summary="The hits of a test, and why one was dropped",
)
def hits(_: Reader, view: View) -> JSONResponse:
    """Return every hit, and what else was left out: the raw file is identified once more for it.

    `record` counts from 0; `reason` says why a hit was dropped, empty where it was used.
    """
    whole = view.whole()
    if whole is None:
        return waiting()
    found = whole.sheet.identification
    hits, dropped = (list(map(asdict, each)) for each in (found.hits, found.dropped))
    return document({"hits": hits, "dropped": dropped})


@router.get(_OF_TEST, summary="One test as it is stored")
def test(_: Reader, view: View) -> JSONResponse:
    """Return modes (an entry of shm.modes/1), quality, what was excluded, and where it comes from.

    `time` is that of receipt where the test has none; `figures` are names for `/figures/{name}`;
    `missing` says why there is no more than the store holds.
    """
    sheet, stored, file = view.as_stored, view.stored, view.recording.file
    before, after = find_neighbours(view.store, stored)
    response = sheet.identification.frequency_response
    found = {
        "test": modes_document.test_document(stored.test),
        "hanger": stored.hanger,
        "time": stored.time,
        "stage": stored.stage.value,
        "verdict": overall(stored.quality),
        "summary": view.summary,
        "quality": [asdict(check) for check in stored.quality],
        "set_aside": [asdict(each) for each in stored.set_aside],
        "notes": list(stored.notes),
        "responses": [point.name for point in response.points] if response else [],
        "file": {
            "file_name": file.file_name,
            "sha256": file.sha256,
            "size_bytes": file.size_bytes,
            "received_at": view.recording.received_at,
            "archived": view.is_archived,
        },
        "lineage": stored.lineage.columns,
        "steps": [{"stage": s.kind, "at": s.at, "version": s.version} for s in steps_of(view)],
        "superseded": [
            {
                "what": "posterior" if model else "identification",
                "model": model,
                "made_at": made_at,
                "superseded_at": former.superseded_at,
                "lineage": former.lineage.columns,
            }
            for model, made_at, former in _replaced(view)
        ],
        "previous": before,
        "next": after,
        "missing": view.missing,
        "figures": [each.name for each in view.figures()],
    }
    return document(found)


def waiting() -> JSONResponse:
    """Return the answer while something is worked out."""
    return JSONResponse({"message": AT_WORK}, 202, RETRY_AFTER)
